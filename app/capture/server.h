// SPDX-License-Identifier: Apache-2.0
//
// The page of a capture, on this machine alone: bound to 127.0.0.1, and every request must name
// this server as its host and, where it says so, come from this server's own page. So no page from
// elsewhere that is open in the same browser can look through the camera or press a button.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <vector>

namespace kinescope {

/// What the server asks for; called from its own threads.
struct CapturePage {
  std::string html;
  std::function<std::string()> state;                  ///< JSON
  std::function<std::vector<std::uint8_t>()> picture;  ///< JPEG; empty: none yet
  std::function<void()> start;
  std::function<void()> stop;
};

class CaptureServer {
 public:
  /// `port` 0: any that is free. Throws bad_request where the port is in use.
  CaptureServer(CapturePage page, int port);
  ~CaptureServer();
  CaptureServer(const CaptureServer&) = delete;
  CaptureServer& operator=(const CaptureServer&) = delete;
  [[nodiscard]] int port() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace kinescope
