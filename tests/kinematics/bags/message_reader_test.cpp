// SPDX-License-Identifier: Apache-2.0
#include "kinematics/bags/message_reader.h"

#include <gtest/gtest.h>

#include "tests/truth/bag_writer.h"

namespace kinescope::bags {
namespace {

TEST(MessageReader, AlignsCdrAndNotRos1) {
  truth::CdrWriter cdr;
  cdr.u8(7).f64(1.5);
  MessageReader aligned(cdr.data(), Encoding::kCdr);
  EXPECT_EQ(aligned.u8(), 7);
  EXPECT_EQ(aligned.f64(), 1.5);

  std::string packed = cdr.data().substr(4, 1) + cdr.data().substr(4 + 8);
  MessageReader plain(packed, Encoding::kRos1);
  EXPECT_EQ(plain.u8(), 7);
  EXPECT_EQ(plain.f64(), 1.5);
}

TEST(MessageReader, SecondVersionOfCdrAlignsToFour) {
  std::string data("\x00\x07\x00\x00", 4);
  data += std::string("\x09\x00\x00\x00", 4);
  data += std::string("\x00\x00\x00\x00\x00\x00\xF8\x3F", 8);  // 1.5
  MessageReader reader(data, Encoding::kCdr);
  EXPECT_EQ(reader.u8(), 9);
  EXPECT_EQ(reader.f64(), 1.5);
}

TEST(MessageReader, RefusesWhatIsTooShortOrOfAnotherLayout) {
  EXPECT_THROW(MessageReader("", Encoding::kCdr), MessageFault);
  EXPECT_THROW(MessageReader(std::string("\x00\x02\x00\x00", 4), Encoding::kCdr), MessageFault);
  EXPECT_THROW(MessageReader(std::string("\x01\x01\x00\x00", 4), Encoding::kCdr), MessageFault);
  EXPECT_THROW(MessageReader("whatever", Encoding::kOther), MessageFault);
  MessageReader end(std::string_view("\x00\x01\x00\x00", 4), Encoding::kCdr);
  EXPECT_THROW(static_cast<void>(end.u32()), MessageFault);
}

TEST(MessageReader, LengthsBeyondTheEndAllocateNothing) {
  const std::string data("\x00\x01\x00\x00\xFF\xFF\xFF\xFF", 8);
  EXPECT_THROW(static_cast<void>(MessageReader(data, Encoding::kCdr).strings()), MessageFault);
  EXPECT_THROW(static_cast<void>(MessageReader(data, Encoding::kCdr).f64s()), MessageFault);
  EXPECT_THROW(static_cast<void>(MessageReader(data, Encoding::kCdr).string()), MessageFault);
}

}  // namespace
}  // namespace kinescope::bags
