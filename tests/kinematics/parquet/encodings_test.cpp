// SPDX-License-Identifier: Apache-2.0
//
// Encodings against examples of the format's own text (parquet-format, Encodings.md).
#include "kinematics/parquet/encodings.h"

#include <limits>

#include <gtest/gtest.h>

#include "kinematics/parquet/damage.h"

namespace kinescope::parquet {
namespace {

using Numbers32 = std::vector<std::uint32_t>;
using Numbers64 = std::vector<std::int64_t>;

std::string bytes_of(std::initializer_list<unsigned> values) {
  std::string out;
  for (const unsigned value : values) out += static_cast<char>(value);
  return out;
}

TEST(HybridNumbers, OfEightNumbersSideBySide) {
  // "The numbers 0 through 7 with bit width 3": 10001000 11000110 11111010.
  const std::string packed = bytes_of({0x03, 0x88, 0xC6, 0xFA});
  EXPECT_EQ(hybrid_numbers(packed, 3, 8), (Numbers32{0, 1, 2, 3, 4, 5, 6, 7}));
}

TEST(HybridNumbers, OfRunsThenNumbers) {
  const std::string mixed = bytes_of({0x0A, 0x05, 0x03, 0x88, 0xC6, 0xFA});  // five times 5
  EXPECT_EQ(hybrid_numbers(mixed, 3, 8), (Numbers32{5, 5, 5, 5, 5, 0, 1, 2}));
  EXPECT_EQ(hybrid_numbers(bytes_of({0x06, 0x34, 0x12}), 12, 3),
            (Numbers32{0x1234, 0x1234, 0x1234}));
}

TEST(HybridNumbers, OfNoBitsAreZero) {
  EXPECT_EQ(hybrid_numbers(bytes_of({0x08}), 0, 4), Numbers32(4, 0U));
  EXPECT_EQ(hybrid_numbers(bytes_of({0x03}), 0, 4), Numbers32(4, 0U));
}

TEST(HybridNumbers, ThatEndEarlyAreRefused) {
  EXPECT_THROW(static_cast<void>(hybrid_numbers("", 1, 1)), Damage);
  EXPECT_THROW(static_cast<void>(hybrid_numbers(bytes_of({0x0A}), 3, 5)), Damage);
  EXPECT_THROW(static_cast<void>(hybrid_numbers(bytes_of({0x03, 0x88}), 3, 8)), Damage);
  EXPECT_THROW(static_cast<void>(hybrid_numbers(bytes_of({0x00, 0x00}), 3, 5)), Damage);
  EXPECT_THROW(static_cast<void>(hybrid_numbers(bytes_of({0x0A, 0x05}), 33, 5)), Damage);
}

/// A head of blocks of 128 in 4 parts.
std::string delta_head(unsigned count, unsigned first_zigzag) {
  return bytes_of({0x80, 0x01, 0x04, count, first_zigzag});
}

TEST(DeltaNumbers, OfTheFormatsFirstExample) {
  // 1, 2, 3, 4, 5: first 1, least difference 1, no bits.
  std::size_t used = 0;
  const std::string bytes = delta_head(5, 2) + bytes_of({0x02, 0, 0, 0, 0, 0xFF});
  EXPECT_EQ(delta_numbers(bytes, 5, used), (Numbers64{1, 2, 3, 4, 5}));
  EXPECT_EQ(used, bytes.size() - 1);
}

TEST(DeltaNumbers, OfTheFormatsSecondExample) {
  // 7, 5, 3, 1, 2, 3, 4, 5: least difference -2, then 0, 0, 0, 3, 3, 3, 3 in two bits.
  std::size_t used = 0;
  const std::string bytes =
      delta_head(8, 14) + bytes_of({0x03, 2, 0, 0, 0, 0xC0, 0x3F}) + std::string(6, '\0');
  EXPECT_EQ(delta_numbers(bytes, 8, used), (Numbers64{7, 5, 3, 1, 2, 3, 4, 5}));
}

TEST(DeltaNumbers, WrapAround) {
  // From the least number one down to the greatest.
  std::size_t used = 0;
  std::string bytes = bytes_of({0x80, 0x01, 0x04, 0x02});
  bytes += std::string(9, '\xFF') + '\x01';  // zigzag of the least number
  bytes += bytes_of({0x01, 0, 0, 0, 0});     // -1
  EXPECT_EQ(delta_numbers(bytes, 2, used), (Numbers64{std::numeric_limits<std::int64_t>::min(),
                                                      std::numeric_limits<std::int64_t>::max()}));
}

TEST(DeltaNumbers, OfBlocksThatCannotBeAreRefused) {
  std::size_t used = 0;
  EXPECT_THROW(static_cast<void>(delta_numbers(bytes_of({0x80, 0x01, 0x00, 5, 2}), 5, used)),
               Damage);
  EXPECT_THROW(static_cast<void>(delta_numbers(bytes_of({0x00, 0x04, 5, 2}), 5, used)), Damage);
  EXPECT_THROW(static_cast<void>(delta_numbers(delta_head(4, 2), 5, used)), Damage);
  EXPECT_THROW(static_cast<void>(delta_numbers(delta_head(5, 2), 5, used)), Damage);
  const std::string wide = delta_head(5, 2) + bytes_of({0x02, 65, 0, 0, 0});
  EXPECT_THROW(static_cast<void>(delta_numbers(wide + std::string(300, '\0'), 5, used)), Damage);
}

}  // namespace
}  // namespace kinescope::parquet
