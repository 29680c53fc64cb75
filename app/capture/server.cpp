// SPDX-License-Identifier: Apache-2.0
#include "app/capture/server.h"

#include <array>
#include <atomic>
#include <thread>
#include <utility>

#include <fmt/format.h>
#include <httplib.h>
#include <sys/socket.h>

#include "kinematics/core/error.h"

namespace kinescope {
namespace {

constexpr const char* kLoopback = "127.0.0.1";
constexpr int kForbidden = 403;
constexpr int kNothing = 204;
constexpr std::size_t kMostBytes = 4096;  // of a request: the page sends none

/// A page from elsewhere cannot leave these headers out or choose them.
bool is_from_own_page(const httplib::Request& request, int port) {
  const std::array<std::string, 2> hosts = {fmt::format("{}:{}", kLoopback, port),
                                            fmt::format("localhost:{}", port)};
  const std::string host = request.get_header_value("Host");
  if (host != hosts[0] && host != hosts[1]) return false;
  if (request.has_header("Origin") && request.get_header_value("Origin") != "http://" + host)
    return false;
  // Pictures of another page have no Origin; browsers say here who asks.
  const std::string site = request.get_header_value("Sec-Fetch-Site");
  return site.empty() || site == "same-origin" || site == "none";
}

// httplib's own choice lets two programs listen on one port.
void share_no_port(socket_t socket) {
  const int yes = 1;
  static_cast<void>(::setsockopt(socket, SOL_SOCKET, SO_REUSEADDR, &yes, sizeof yes));
}

}  // namespace

struct CaptureServer::Impl {
  CapturePage page;
  httplib::Server server;
  int port = 0;
  std::atomic<bool> ended = false;
  std::thread thread;

  void add_handlers() {
    server.set_payload_max_length(kMostBytes);
    server.set_keep_alive_timeout(1);  // s; the end waits for it
    server.set_default_headers({{"Cache-Control", "no-store"},
                                {"X-Content-Type-Options", "nosniff"},
                                {"X-Frame-Options", "DENY"},
                                {"Cross-Origin-Resource-Policy", "same-origin"}});
    server.set_pre_routing_handler([this](const httplib::Request& request, httplib::Response& out) {
      if (is_from_own_page(request, port)) return httplib::Server::HandlerResponse::Unhandled;
      out.status = kForbidden;
      out.set_content("only for the page of kinescope capture\n", "text/plain");
      return httplib::Server::HandlerResponse::Handled;
    });
    server.Get("/", [this](const httplib::Request&, httplib::Response& out) {
      out.set_content(page.html, "text/html; charset=utf-8");
    });
    server.Get("/state", [this](const httplib::Request&, httplib::Response& out) {
      out.set_content(page.state(), "application/json");
    });
    server.Get("/picture.jpg", [this](const httplib::Request&, httplib::Response& out) {
      const std::vector<std::uint8_t> jpeg = page.picture();
      if (jpeg.empty()) {
        out.status = kNothing;
      } else {
        out.set_content(reinterpret_cast<const char*>(jpeg.data()), jpeg.size(), "image/jpeg");
      }
    });
    const auto press = [](const std::function<void()>& button) {
      return [&button](const httplib::Request&, httplib::Response& out) {
        button();
        out.status = kNothing;
      };
    };
    server.Post("/start", press(page.start));
    server.Post("/stop", press(page.stop));
  }
};

CaptureServer::CaptureServer(CapturePage page, int port) : impl_(std::make_unique<Impl>()) {
  impl_->page = std::move(page);
  impl_->server.set_socket_options(share_no_port);
  const bool bound = port == 0 ? (impl_->port = impl_->server.bind_to_any_port(kLoopback)) > 0
                               : impl_->server.bind_to_port(kLoopback, port);
  if (!bound) {
    throw bad_request(fmt::format("--port {}", port), "the port is in use, or not allowed",
                      "name another one, or 0 for any that is free");
  }
  if (port != 0) impl_->port = port;
  impl_->add_handlers();
  impl_->thread = std::thread([impl = impl_.get()] {
    impl->server.listen_after_bind();
    impl->ended = true;
  });
}

CaptureServer::~CaptureServer() {
  // stop() does nothing before the thread listens, and join() would then wait for ever.
  while (!impl_->server.is_running() && !impl_->ended) std::this_thread::yield();
  impl_->server.stop();
  impl_->thread.join();
}

int CaptureServer::port() const { return impl_->port; }

}  // namespace kinescope
