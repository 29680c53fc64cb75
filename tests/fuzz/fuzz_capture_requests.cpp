// SPDX-License-Identifier: Apache-2.0
//
// Bytes on a connection to the page of a capture; "{port}" in them becomes the server's port.
// Nothing is shown and no button pressed for a request that names no host of this server.
#include <atomic>
#include <cerrno>

#include <arpa/inet.h>
#include <netinet/in.h>
#include <sys/socket.h>

#include "app/capture/server.h"
#include "tests/fuzz/fuzz_target.h"

namespace {

using namespace kinescope;

std::atomic<int> asked = 0;

CapturePage counting_page() {
  const auto count = [] { ++asked; };
  return {.html = "<!doctype html><title>page</title>",
          .state =
              [count] {
                count();
                return std::string("{}");
              },
          .picture =
              [count] {
                count();
                return std::vector<std::uint8_t>{0xFF, 0xD8, 0xFF, 0xD9};
              },
          .start = count,
          .stop = count};
}

std::string with_port(std::string text, int port) {
  constexpr std::string_view kPort = "{port}";
  for (std::size_t at = text.find(kPort); at != std::string::npos; at = text.find(kPort, at))
    text.replace(at, kPort.size(), std::to_string(port));
  return text;
}

// What comes back until the server closes; it has five seconds.
void send_and_read(const std::string& text, int port) {
  const int connection = ::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
  const timeval patience{5, 0};
  ::setsockopt(connection, SOL_SOCKET, SO_RCVTIMEO, &patience, sizeof patience);
  // Closed connections keep their addresses for a minute: each comes from another one of
  // 127.0.0.0/16.
  static std::uint32_t connections = 0;
  sockaddr_in own{}, server{};
  own.sin_family = server.sin_family = AF_INET;
  own.sin_addr.s_addr = htonl(INADDR_LOOPBACK + ++connections % 60000U);
  server.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  server.sin_port = htons(static_cast<std::uint16_t>(port));
  // NOLINTBEGIN(*-reinterpret-cast): the interface of sockets
  const bool bound = ::bind(connection, reinterpret_cast<sockaddr*>(&own), sizeof own) == 0;
  const int reached = ::connect(connection, reinterpret_cast<sockaddr*>(&server), sizeof server);
  // NOLINTEND(*-reinterpret-cast)
  KINESCOPE_CHECK(bound && reached == 0, "the server listens");
  static_cast<void>(::send(connection, text.data(), text.size(), MSG_NOSIGNAL));
  ::shutdown(connection, SHUT_WR);
  char buffer[4096];
  ssize_t n = 1;
  while (n > 0) n = ::recv(connection, buffer, sizeof buffer, 0);
  const bool waited = n < 0 && (errno == EAGAIN || errno == EWOULDBLOCK);
  ::close(connection);
  KINESCOPE_CHECK(!waited, "the server ends the connection");
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static CaptureServer server(counting_page(), 0);
  const std::string text = with_port(std::string(fuzz::text_of(data, size)), server.port());
  const int before = asked;
  send_and_read(text, server.port());
  const bool names_host = text.find(":" + std::to_string(server.port())) != std::string::npos;
  KINESCOPE_CHECK(asked == before || names_host, "only requests to this server are answered");
  return 0;
}
