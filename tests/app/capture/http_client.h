// SPDX-License-Identifier: Apache-2.0
//
// A client that sends whatever headers a test wants.
#pragma once

#include <array>
#include <string>

#include <arpa/inet.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

namespace kinescope {

/// The whole answer with its head; empty where nobody listens. `headers`: lines that end in \r\n.
inline std::string http_request(int port, const std::string& method, const std::string& path,
                                const std::string& headers) {
  const int socket = ::socket(AF_INET, SOCK_STREAM, 0);
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_port = htons(static_cast<std::uint16_t>(port));
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  std::string answer;
  if (::connect(socket, reinterpret_cast<const sockaddr*>(&address), sizeof address) == 0) {
    const std::string text = method + " " + path + " HTTP/1.1\r\n" + headers +
                             "Content-Length: 0\r\nConnection: close\r\n\r\n";
    static_cast<void>(::send(socket, text.data(), text.size(), 0));
    std::array<char, 65536> buffer{};
    for (ssize_t n = ::recv(socket, buffer.data(), buffer.size(), 0); n > 0;
         n = ::recv(socket, buffer.data(), buffer.size(), 0))
      answer.append(buffer.data(), static_cast<std::size_t>(n));
  }
  ::close(socket);
  return answer;
}

inline std::string own_host(int port) { return "Host: 127.0.0.1:" + std::to_string(port) + "\r\n"; }

/// Of an answer.
inline int status_of(const std::string& answer) {
  return answer.size() < 12 ? 0 : std::stoi(answer.substr(9, 3));
}

}  // namespace kinescope
