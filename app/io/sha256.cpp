// SPDX-License-Identifier: Apache-2.0
#include "app/io/sha256.h"

#include <array>
#include <fstream>
#include <memory>

#include <fmt/format.h>
#include <openssl/evp.h>

#include "kinematics/core/error.h"

namespace kinescope {
namespace {

class Hasher {
 public:
  Hasher() : context_(EVP_MD_CTX_new(), &EVP_MD_CTX_free) {
    KINESCOPE_CHECK(context_ && EVP_DigestInit_ex(context_.get(), EVP_sha256(), nullptr) == 1,
                    "SHA-256 is available");
  }
  void add(std::string_view bytes) { EVP_DigestUpdate(context_.get(), bytes.data(), bytes.size()); }
  [[nodiscard]] std::string hexadecimal() {
    std::array<unsigned char, EVP_MAX_MD_SIZE> digest{};
    unsigned int size = 0;
    EVP_DigestFinal_ex(context_.get(), digest.data(), &size);
    std::string text;
    for (unsigned int i = 0; i < size; ++i) text += fmt::format("{:02x}", digest[i]);
    return text;
  }

 private:
  std::unique_ptr<EVP_MD_CTX, decltype(&EVP_MD_CTX_free)> context_;
};

}  // namespace

std::string sha256_of_file(const std::filesystem::path& path) {
  std::ifstream stream(path, std::ios::binary);
  if (!stream || std::filesystem::is_directory(path)) {
    throw bad_input(path.string(), "cannot be read", "check the path and its permissions");
  }
  Hasher hasher;
  std::array<char, std::size_t{1} << 16U> block{};
  while (stream.read(block.data(), block.size()) || stream.gcount() > 0) {
    hasher.add({block.data(), static_cast<std::size_t>(stream.gcount())});
  }
  if (stream.bad()) throw bad_input(path.string(), "cannot be read to its end", "check the disk");
  return hasher.hexadecimal();
}

std::string sha256_of_text(std::string_view text) {
  Hasher hasher;
  hasher.add(text);
  return hasher.hexadecimal();
}

}  // namespace kinescope
