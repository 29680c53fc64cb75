// SPDX-License-Identifier: Apache-2.0
#include "kinematics/parquet/unpack_page.h"

#include <snappy-c.h>
#include <zstd.h>

#include "kinematics/core/error.h"
#include "kinematics/core/gzip.h"
#include "kinematics/parquet/damage.h"

namespace kinescope::parquet {
namespace {

Damage not_what_it_declares() { return {"a page does not unpack to what it declares"}; }

// A byte of these formats stands for no more than so many: what declares more lies, and would take
// memory that nothing is ever written to (snappy: copies of 64 bytes take 3; deflate: 258 for 2
// bits).
constexpr std::size_t kMostOfSnappy = 64;
constexpr std::size_t kMostOfGzip = 1032;

std::string unsnappy(std::string_view packed, std::size_t size) {
  std::size_t declared = 0;
  const bool known =
      snappy_uncompressed_length(packed.data(), packed.size(), &declared) == SNAPPY_OK;
  if (!known || declared != size || size / kMostOfSnappy > packed.size())
    throw not_what_it_declares();
  std::string out(size, '\0');
  if (snappy_uncompress(packed.data(), packed.size(), out.data(), &declared) != SNAPPY_OK ||
      declared != size) {
    throw not_what_it_declares();
  }
  return out;
}

std::string unzstd(std::string_view packed, std::size_t size) {
  std::string out(size, '\0');
  const std::size_t made = ZSTD_decompress(out.data(), size, packed.data(), packed.size());
  if (ZSTD_isError(made) != 0U || made != size) throw not_what_it_declares();
  return out;
}

std::string ungzip(std::string_view packed, std::size_t size) {
  if (size / kMostOfGzip > packed.size()) throw not_what_it_declares();
  std::string out;
  try {
    out = gunzip(packed, "page", size);
  } catch (const Error&) {
    throw not_what_it_declares();
  }
  if (out.size() != size) throw not_what_it_declares();
  return out;
}

}  // namespace

std::string unpack_page(Codec codec, std::string_view packed, std::size_t size) {
  if (size > kLargestPage) throw NotRead{"pages of more than 256 MiB"};
  switch (codec) {
    case Codec::kNone:
      if (packed.size() != size) throw not_what_it_declares();
      return std::string(packed);
    case Codec::kSnappy:
      return unsnappy(packed, size);
    case Codec::kGzip:
      return ungzip(packed, size);
    case Codec::kZstd:
      return unzstd(packed, size);
  }
  throw not_what_it_declares();
}

}  // namespace kinescope::parquet
