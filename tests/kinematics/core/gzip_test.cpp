// SPDX-License-Identifier: Apache-2.0
#include "kinematics/core/gzip.h"

#include <cstdlib>
#include <filesystem>
#include <string>

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include "kinematics/core/csv.h"
#include "kinematics/core/error.h"
#include "kinematics/core/file.h"
#include "tests/truth/temporary_path.h"

namespace kinescope {
namespace {

std::string gunzip_refusal(std::string_view bytes, std::uintmax_t max_bytes = 1U << 20U) {
  try {
    static_cast<void>(gunzip(bytes, "log.csv.gz", max_bytes));
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ExitCode::kBadInput);
    return error.what();
  }
  return "accepted";
}

RC_GTEST_PROP(Gzip, GivesBackWhatWasPacked, (const std::string& bytes)) {
  RC_ASSERT(gunzip(gzip(bytes), "x") == bytes);
}

RC_GTEST_PROP(Gzip, ReadsMembersInTheirOrder, (const std::string& a, const std::string& b)) {
  RC_ASSERT(gunzip(gzip(a) + gzip(b), "x") == a + b);
}

RC_GTEST_PROP(Gzip, RefusesEveryTruncation, (const std::string& bytes)) {
  const std::string packed = gzip(bytes);
  const auto length = *rc::gen::inRange<std::size_t>(1, packed.size());
  RC_ASSERT(gunzip_refusal(std::string_view(packed).substr(0, length)) != "accepted");
}

TEST(Gzip, SaysWhatIsWrong) {
  const std::string packed = gzip(std::string(100000, 'a') + "bcd");
  EXPECT_NE(gunzip_refusal(packed.substr(0, packed.size() - 3)).find("cut off"), std::string::npos);
  std::string flipped = packed;
  flipped[packed.size() - 6] = static_cast<char>(flipped[packed.size() - 6] ^ 1);  // checksum
  EXPECT_NE(gunzip_refusal(flipped).find("damaged"), std::string::npos);
  EXPECT_NE(gunzip_refusal(packed + "tail").find("bytes follow the end"), std::string::npos);
  EXPECT_NE(gunzip_refusal("t,q1\n").find("is no gzip file"), std::string::npos);
  EXPECT_NE(gunzip_refusal(packed, 1000).find("more than 1000 bytes"), std::string::npos);
}

TEST(Gzip, PacksTheSameBytesTwice) { EXPECT_EQ(gzip("t,q1\n0,1\n"), gzip("t,q1\n0,1\n")); }

TEST(Gzip, TablesAreReadPackedOrPlain) {
  const std::filesystem::path folder = truth::temporary_path("gzip");
  std::filesystem::create_directories(folder);
  const std::string text = "t,q1\n0,1\n1,2\n";
  write_file_atomically(folder / "log.csv", text);
  write_file_atomically(folder / "log.csv.gz", gzip(text));
  EXPECT_EQ(read_csv(folder / "log.csv.gz").rows, read_csv(folder / "log.csv").rows);
}

}  // namespace
}  // namespace kinescope
