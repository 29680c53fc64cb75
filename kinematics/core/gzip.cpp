// SPDX-License-Identifier: Apache-2.0
#include "kinematics/core/gzip.h"

#include <array>
#include <limits>

#include <fmt/format.h>
#include <zlib.h>

#include "kinematics/core/error.h"
#include "kinematics/core/file.h"

namespace kinescope {
namespace {

constexpr int kGzipWindow = 15 + 16;  // zlib: largest window, gzip header
constexpr std::size_t kBlock = std::size_t{1} << 16U;

const Bytef* as_bytes(std::string_view text) {
  return reinterpret_cast<const Bytef*>(text.data());  // NOLINT(*-reinterpret-cast): zlib's type
}

/// zlib's stream, ended whatever happens.
class Inflater {
 public:
  Inflater() { KINESCOPE_CHECK(inflateInit2(&stream_, kGzipWindow) == Z_OK, "zlib has no memory"); }
  ~Inflater() { inflateEnd(&stream_); }
  Inflater(const Inflater&) = delete;
  Inflater& operator=(const Inflater&) = delete;
  Inflater(Inflater&&) = delete;
  Inflater& operator=(Inflater&&) = delete;

  /// Unpacks one member into `text`; gives the packed bytes used.
  std::size_t member(std::string_view bytes, std::string_view source, std::uintmax_t max_bytes,
                     std::string& text) {
    inflateReset(&stream_);
    stream_.next_in = const_cast<Bytef*>(as_bytes(bytes));  // NOLINT(*-const-cast): zlib's type
    stream_.avail_in = static_cast<uInt>(bytes.size());
    std::array<Bytef, kBlock> block{};
    int state = Z_OK;
    while (state != Z_STREAM_END) {
      stream_.next_out = block.data();
      stream_.avail_out = kBlock;
      state = inflate(&stream_, Z_NO_FLUSH);
      const std::size_t made = kBlock - stream_.avail_out;
      text.append(reinterpret_cast<const char*>(block.data()),  // NOLINT(*-reinterpret-cast)
                  made);
      if (text.size() > max_bytes) {
        throw bad_input(source, fmt::format("more than {} bytes when unpacked", max_bytes),
                        "is this the right file?");
      }
      if (state == Z_BUF_ERROR || (state == Z_OK && stream_.avail_in == 0 && made == 0)) {
        throw bad_input(source, "the gzip file is cut off", "copy or record it again");
      }
      if (state != Z_OK && state != Z_STREAM_END) {
        throw bad_input(source, "the gzip file is damaged", "copy it again (gzip -t checks it)");
      }
    }
    return bytes.size() - stream_.avail_in;
  }

 private:
  z_stream stream_{};
};

}  // namespace

bool is_gzip(std::string_view bytes) { return bytes.starts_with("\x1f\x8b"); }

std::string gunzip(std::string_view bytes, std::string_view source, std::uintmax_t max_bytes) {
  if (bytes.size() > std::numeric_limits<uInt>::max()) {
    throw bad_input(source, "larger than 4 GB", "cut it into several files");
  }
  if (!is_gzip(bytes)) throw bad_input(source, "is no gzip file", "remove .gz from its name");
  Inflater inflater;
  std::string text;
  while (!bytes.empty()) {
    if (!is_gzip(bytes)) {
      throw bad_input(source, "bytes follow the end of the gzip file", "copy or record it again");
    }
    bytes.remove_prefix(inflater.member(bytes, source, max_bytes, text));
  }
  return text;
}

std::string gzip(std::string_view bytes) {
  KINESCOPE_CHECK(bytes.size() < std::numeric_limits<uInt>::max(), "too large to pack");
  z_stream stream{};
  KINESCOPE_CHECK(deflateInit2(&stream, Z_DEFAULT_COMPRESSION, Z_DEFLATED, kGzipWindow, 8,
                               Z_DEFAULT_STRATEGY) == Z_OK,
                  "zlib has no memory");
  std::string packed(deflateBound(&stream, static_cast<uLong>(bytes.size())), '\0');
  stream.next_in = const_cast<Bytef*>(as_bytes(bytes));  // NOLINT(*-const-cast): zlib's type
  stream.avail_in = static_cast<uInt>(bytes.size());
  stream.next_out = reinterpret_cast<Bytef*>(packed.data());  // NOLINT(*-reinterpret-cast)
  stream.avail_out = static_cast<uInt>(packed.size());
  const int state = deflate(&stream, Z_FINISH);
  packed.resize(stream.total_out);
  deflateEnd(&stream);
  KINESCOPE_CHECK(state == Z_STREAM_END, "deflate did not end");
  return packed;
}

std::string read_plain_or_gzip(const std::filesystem::path& path) {
  std::string bytes = read_text_file(path);
  if (is_gzip(bytes) || path.extension() == ".gz") return gunzip(bytes, path.string());
  return bytes;
}

}  // namespace kinescope
