// SPDX-License-Identifier: Apache-2.0
#include "kinematics/bags/unpack.h"

#include <algorithm>
#include <array>
#include <fstream>
#include <limits>
#include <memory>

#include <bzlib.h>
#include <lz4frame.h>
#include <zstd.h>

#include "kinematics/core/error.h"

namespace kinescope::bags {
namespace {

constexpr std::size_t kStep = std::size_t{1} << 17U;

/// What a step of a stream did.
enum class Step { kMore, kEnd, kFault };

struct Progress {
  std::size_t used = 0;
  std::size_t made = 0;
  Step step = Step::kFault;
};

class ZstdStream {
 public:
  Progress advance(std::string_view in, char* out, std::size_t room) {
    ZSTD_inBuffer from{in.data(), in.size(), 0};
    ZSTD_outBuffer to{out, room, 0};
    const std::size_t status = ZSTD_decompressStream(stream_.get(), &to, &from);
    if (ZSTD_isError(status) != 0U) return {from.pos, to.pos, Step::kFault};
    return {from.pos, to.pos, status == 0 ? Step::kEnd : Step::kMore};
  }

 private:
  struct Free {
    void operator()(ZSTD_DStream* stream) const { ZSTD_freeDStream(stream); }
  };
  std::unique_ptr<ZSTD_DStream, Free> stream_{ZSTD_createDStream()};
};

class Lz4Stream {
 public:
  Lz4Stream() {
    LZ4F_dctx* made = nullptr;
    KINESCOPE_CHECK(LZ4F_isError(LZ4F_createDecompressionContext(&made, LZ4F_VERSION)) == 0U,
                    "lz4 has no memory");
    stream_.reset(made);
  }
  Progress advance(std::string_view in, char* out, std::size_t room) {
    std::size_t used = in.size();
    const std::size_t status =
        LZ4F_decompress(stream_.get(), out, &room, in.data(), &used, nullptr);
    if (LZ4F_isError(status) != 0U) return {0, 0, Step::kFault};
    return {used, room, status == 0 ? Step::kEnd : Step::kMore};
  }

 private:
  struct Free {
    void operator()(LZ4F_dctx* stream) const { LZ4F_freeDecompressionContext(stream); }
  };
  std::unique_ptr<LZ4F_dctx, Free> stream_;
};

class Bzip2Stream {
 public:
  Bzip2Stream() {
    KINESCOPE_CHECK(BZ2_bzDecompressInit(&stream_, 0, 0) == BZ_OK, "bzip2 has no memory");
  }
  ~Bzip2Stream() { BZ2_bzDecompressEnd(&stream_); }
  Bzip2Stream(const Bzip2Stream&) = delete;
  Bzip2Stream& operator=(const Bzip2Stream&) = delete;
  Bzip2Stream(Bzip2Stream&&) = delete;
  Bzip2Stream& operator=(Bzip2Stream&&) = delete;

  Progress advance(std::string_view in, char* out, std::size_t room) {
    constexpr std::size_t kMost = std::numeric_limits<unsigned>::max();
    const auto in_size = static_cast<unsigned>(std::min(in.size(), kMost));
    const auto out_size = static_cast<unsigned>(std::min(room, kMost));
    stream_.next_in = const_cast<char*>(in.data());  // NOLINT(*-const-cast): bzip2's type
    stream_.avail_in = in_size;
    stream_.next_out = out;
    stream_.avail_out = out_size;
    const int status = BZ2_bzDecompress(&stream_);
    const std::size_t used = in_size - stream_.avail_in;
    const std::size_t made = out_size - stream_.avail_out;
    if (status == BZ_STREAM_END) return {used, made, Step::kEnd};
    return {used, made, status == BZ_OK ? Step::kMore : Step::kFault};
  }

 private:
  bz_stream stream_{};
};

template <typename Stream>
Unpacked unpack_with(Stream stream, std::string_view packed, std::uint64_t most, bool declared) {
  Unpacked out;
  while (true) {
    const std::size_t before = out.bytes.size();
    // One byte more than is allowed, so that what goes on beyond is seen.
    const std::size_t room =
        static_cast<std::size_t>(std::min<std::uint64_t>(kStep, most - before + 1));
    out.bytes.resize(before + room);
    const Progress progress = stream.advance(packed, out.bytes.data() + before, room);
    out.bytes.resize(before + progress.made);
    packed.remove_prefix(progress.used);
    if (out.bytes.size() > most) {
      out.bytes.resize(static_cast<std::size_t>(most));
      return out;
    }
    if (progress.step == Step::kFault) return out;
    if (progress.step == Step::kEnd) {
      out.whole = !declared || out.bytes.size() == most;
      return out;
    }
    if (progress.used == 0 && progress.made == 0) return out;  // cut off
  }
}

}  // namespace

std::optional<Packing> packing_named(std::string_view name) {
  if (name.empty() || name == "none") return Packing::kNone;
  if (name == "zstd") return Packing::kZstd;
  if (name == "lz4") return Packing::kLz4;
  if (name == "bz2") return Packing::kBzip2;
  return std::nullopt;
}

Unpacked unpack(Packing packing, std::string_view packed, std::optional<std::uint64_t> size) {
  const std::uint64_t most = size.value_or(kLargestBlock);
  if (most > kLargestBlock) return {};
  switch (packing) {
    case Packing::kNone:
      return {std::string(packed), !size || packed.size() == *size};
    case Packing::kZstd:
      return unpack_with(ZstdStream(), packed, most, size.has_value());
    case Packing::kLz4:
      return unpack_with(Lz4Stream(), packed, most, size.has_value());
    case Packing::kBzip2:
      return unpack_with(Bzip2Stream(), packed, most, size.has_value());
  }
  return {};
}

void unpack_zstd_file(const std::filesystem::path& packed, const std::filesystem::path& out) {
  std::ifstream in(packed, std::ios::binary);
  std::ofstream to(out, std::ios::binary);
  std::string block(kStep, '\0');
  std::string made(kStep, '\0');
  ZstdStream stream;
  Step last = Step::kFault;
  while (to &&
         (in.read(block.data(), static_cast<std::streamsize>(block.size())) || in.gcount() > 0)) {
    std::string_view left(block.data(), static_cast<std::size_t>(in.gcount()));
    bool full = false;  // more may come out of what went in
    while (!left.empty() || full) {
      const Progress progress = stream.advance(left, made.data(), made.size());
      last = progress.step;
      if (last == Step::kFault) {
        throw bad_input(packed.string(), "the zstd file is damaged",
                        "copy it again (zstd -t checks it)");
      }
      if (!to.write(made.data(), static_cast<std::streamsize>(progress.made))) break;
      left.remove_prefix(progress.used);
      full = last == Step::kMore && progress.made == made.size();
      if (progress.used == 0 && progress.made == 0) break;
    }
  }
  if (to && last != Step::kEnd) {
    throw bad_input(packed.string(), "the zstd file is cut off", "copy or record it again");
  }
  if (!to.flush()) {
    throw bad_input(packed.string(), "does not fit beside the temporary files when unpacked",
                    "make space, or unpack it (zstd -d)");
  }
}

}  // namespace kinescope::bags
