// SPDX-License-Identifier: Apache-2.0
#include "kinematics/mat/mat_file.h"

#include <array>
#include <cmath>
#include <filesystem>

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include "kinematics/core/error.h"
#include "kinematics/core/rng.h"
#include "kinematics/mat/mat_elements.h"
#include "kinematics/mat/mat_log.h"
#include "kinematics/recorded/recorded_log.h"
#include "tests/kinematics/mat/mat_writer.h"

namespace kinescope::mat {
namespace {

std::string refusal(const std::string& bytes) {
  try {
    static_cast<void>(table_of(parse_variables(bytes, "log.mat"), "log.mat"));
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ExitCode::kBadInput);
    EXPECT_EQ(std::string_view(error.what()).find('\n'), std::string_view::npos);
    return error.what();
  }
  return "accepted";
}

const std::vector<MatFormat> kFormats{{false, false}, {false, true}, {true, false}, {true, true}};

RC_GTEST_PROP(MatFile, GivesBackEveryNumber, (unsigned seed)) {
  Rng rng(seed);
  const MatFormat format = kFormats[static_cast<std::size_t>(rng.index(4))];
  const int rows = 1 + rng.index(40), columns = 1 + rng.index(6);
  Eigen::MatrixXd expected(rows, columns);
  for (int i = 0; i < expected.size(); ++i) expected(i) = std::exp(rng.uniform(-300.0, 300.0));
  const std::vector<double> values(expected.data(), expected.data() + expected.size());
  MatWriter writer(format);
  writer.doubles("first", 1, 1, {7.0}).doubles("q_1", rows, columns, values);
  const Contents read = parse_variables(writer.bytes(), "log.mat");
  RC_ASSERT(read.variables.size() == 2U);
  RC_ASSERT(read.variables[1].name == "q_1");
  RC_ASSERT(read.variables[1].values == expected);
}

// MATLAB stores whole numbers of a double array in the smallest type that holds them.
TEST(MatFile, EveryStorageOfNumbersIsRead) {
  for (const MatFormat& format : kFormats) {
    MatWriter writer(format);
    writer.matrix<std::int8_t>("a", 1, 3, {-3, 0, 5}, 1, 6)
        .matrix<std::uint8_t>("b", 1, 3, {3, 0, 255}, 2, 6)
        .matrix<std::int16_t>("c", 1, 3, {-300, 0, 5}, 3, 10)
        .matrix<std::uint16_t>("d", 1, 3, {3, 0, 65535}, 4, 11)
        .matrix<std::int32_t>("e", 1, 3, {-70000, 0, 5}, 5, 12)
        .matrix<std::uint32_t>("f", 1, 3, {3, 0, 4e9}, 6, 13)
        .matrix<float>("g", 1, 3, {-0.5, 0, 1e30F}, 7, 7)
        .matrix<std::int64_t>("h", 1, 3, {-5e12, 0, 5}, 12, 14)
        .matrix<std::uint64_t>("i", 1, 3, {5e12, 0, 5}, 13, 15);
    const Contents read = parse_variables(writer.bytes(), "log.mat");
    ASSERT_EQ(read.variables.size(), 9U);
    const std::vector<std::array<double, 2>> ends{{-3, 5},       {3, 255},    {-300, 5},
                                                  {3, 65535},    {-70000, 5}, {3, 4e9},
                                                  {-0.5, 1e30F}, {-5e12, 5},  {5e12, 5}};
    for (std::size_t k = 0; k < 9; ++k) {
      EXPECT_EQ(read.variables[k].values(0, 0), ends[k][0]) << k;
      EXPECT_EQ(read.variables[k].values(0, 2), ends[k][1]) << k;
    }
  }
}

TEST(MatFile, WhatIsNoMatrixOfNumbersIsLeftOut) {
  MatWriter writer;
  writer.doubles("t", 3, 1, {0, 1, 2})
      .matrix<std::uint16_t>("words", 1, 2, {72, 105}, 4, 4)
      .matrix<double>("z", 1, 3, {1, 2, 3}, 9, 6, 0x0800)
      .matrix<double>("log", 1, 1, {}, 9, 2);
  const Contents read = parse_variables(writer.bytes(), "log.mat");
  ASSERT_EQ(read.variables.size(), 1U);
  ASSERT_EQ(read.left_out.size(), 3U);
  const ChannelTable table = table_of(read, "log.mat");
  ASSERT_EQ(table.warnings.size(), 1U);
  for (const char* part : {"words (a text)", "z (complex)", "log (a struct)", "-struct NAME"})
    EXPECT_NE(table.warnings[0].find(part), std::string::npos) << table.warnings[0];
}

// Tables, times and strings of MATLAB have no sizes element (class 17); Octave has names that begin
// with an underscore.
TEST(MatFile, ObjectsOfMatlabAreLeftOutAndNamesOfOctaveAreNames) {
  for (const MatFormat& format : kFormats) {
    MatWriter writer(format);
    writer.doubles("t", 3, 1, {0, 1, 2})
        .variable(writer.element(6, writer.number(17U) + writer.number(0U)) +
                  writer.element(1, "when") + writer.element(1, "MCOS") +
                  writer.element(1, "datetime"))
        .doubles("_q", 3, 1, {4, 5, 6});
    const Contents read = parse_variables(writer.bytes(), "log.mat");
    ASSERT_EQ(read.variables.size(), 2U);
    EXPECT_EQ(read.variables[1].name, "_q");
    ASSERT_EQ(read.left_out.size(), 1U);
    EXPECT_EQ(read.left_out[0].name, "when");
    EXPECT_EQ(read.left_out[0].what, "an object");
  }
}

TEST(MatLog, AScalarTimeIsNoColumn) {
  MatWriter writer;
  writer.doubles("t", 1, 1, {4.0}).doubles("time", 3, 1, {0, 1, 2}).doubles("q", 3, 1, {1, 2, 3});
  const ChannelTable table = table_of(parse_variables(writer.bytes(), "log.mat"), "log.mat");
  EXPECT_EQ(table.names, (std::vector<std::string>{"time", "q"}));
}

TEST(MatLog, MatricesAreAColumnAJointWhicheverWayTheyStand) {
  MatWriter writer;
  writer.doubles("t", 1, 4, {0, 1, 2, 3})
      .doubles("q", 4, 2, {1, 2, 3, 4, 5, 6, 7, 8})
      .doubles("tau", 2, 4, {1, 5, 2, 6, 3, 7, 4, 8})
      .doubles("gains", 2, 3, {1, 2, 3, 4, 5, 6})
      .doubles("payload", 1, 1, {2});
  const ChannelTable table = table_of(parse_variables(writer.bytes(), "log.mat"), "log.mat");
  EXPECT_EQ(table.names, (std::vector<std::string>{"t", "q1", "q2", "tau1", "tau2"}));
  EXPECT_EQ(table.values.rows(), 4);
  EXPECT_EQ(table.values.col(1), table.values.col(3));
  EXPECT_EQ(table.values.col(2), table.values.col(4));
  EXPECT_EQ(table.values(2, 2), 7.0);
  ASSERT_EQ(table.warnings.size(), 1U);
  EXPECT_NE(table.warnings[0].find("gains (2 x 3), payload (1 x 1)"), std::string::npos);
}

TEST(MatLog, WithoutATimeMostVariablesSayHowManySamplesThereAre) {
  MatWriter writer;
  writer.doubles("wide", 1, 7, {0, 0, 0, 0, 0, 0, 0})
      .doubles("q1", 3, 1, {1, 2, 3})
      .doubles("tau1", 1, 3, {4, 5, 6});
  const ChannelTable table = table_of(parse_variables(writer.bytes(), "log.mat"), "log.mat");
  EXPECT_EQ(table.names, (std::vector<std::string>{"q1", "tau1"}));
}

// Files of SciPy (data/README.md).
TEST(MatLog, FilesOfAnotherWriterAreRead) {
  for (const char* name : {"log_v6.mat", "log_v7.mat"}) {
    const ChannelTable table = recorded::read_channel_table(
        std::filesystem::path(KINESCOPE_SOURCE_DIR) / "tests/kinematics/mat/data" / name);
    EXPECT_EQ(table.names,
              (std::vector<std::string>{"t", "q1", "q2", "dq1", "dq2", "tau1", "tau2", "mode"}));
    ASSERT_EQ(table.values.rows(), 50);
    for (int i = 0; i < 50; ++i) {
      EXPECT_NEAR(table.values(i, 0), 0.01 * i, 1e-15);
      for (int j = 0; j < 2; ++j) {
        EXPECT_NEAR(table.values(i, 1 + j), std::sin(0.3 * i + j), 1e-14);
        EXPECT_NEAR(table.values(i, 3 + j), 0.3 * std::cos(0.3 * i + j), 1e-14);
        EXPECT_NEAR(table.values(i, 5 + j), 0.5 * std::sin(0.1 * i * (j + 1)), 1e-7);
      }
      EXPECT_EQ(table.values(i, 7), i % 7);
    }
    ASSERT_EQ(table.warnings.size(), 1U);
    for (const char* part : {"gains (1 x 3)", "robot (a text)", "settings (a struct)",
                             "z (complex)", "cube (of 3 dimensions)"})
      EXPECT_NE(table.warnings[0].find(part), std::string::npos) << table.warnings[0];
  }
}

TEST(MatLog, RefusesWhatIsNoLog) {
  EXPECT_NE(refusal(MatWriter().doubles("k", 1, 1, {1}).bytes()).find("no variable with samples"),
            std::string::npos);
  const std::string twice = refusal(
      MatWriter().doubles("q", 3, 2, {1, 2, 3, 4, 5, 6}).doubles("q1", 3, 1, {1, 2, 3}).bytes());
  EXPECT_NE(twice.find("two columns would be named 'q1'"), std::string::npos) << twice;
}

TEST(MatFile, OtherVersionsAreNamedWithTheRemedy) {
  std::string hdf5 = "MATLAB 7.3 MAT-file, Platform: GLNXA64, HDF5 schema 1.00 .";
  hdf5.resize(512, ' ');
  for (const std::string& bytes : {hdf5, std::string("\x89HDF\r\n\x1a\n and more", 18)}) {
    const std::string said = refusal(bytes);
    EXPECT_NE(said.find("7.3 (HDF5)"), std::string::npos) << said;
    EXPECT_NE(said.find("save -v7"), std::string::npos) << said;
  }
  EXPECT_NE(refusal("").find("empty"), std::string::npos);
  EXPECT_NE(refusal(std::string(200, '\0')).find("no MAT-file of level 5"), std::string::npos);
  EXPECT_NE(refusal("t,q1\n0,1\n").find("no MAT-file of level 5"), std::string::npos);
}

TEST(MatFile, DamageIsNamed) {
  MatWriter writer;
  const std::string whole = writer.doubles("t", 3, 1, {0, 1, 2}).bytes();
  for (std::size_t size = 129; size < whole.size(); ++size)
    EXPECT_NE(refusal(whole.substr(0, size)).find("damaged"), std::string::npos) << size;
  const std::string packed = MatWriter({false, true}).doubles("t", 3, 1, {0, 1, 2}).bytes();
  for (std::size_t size = 129; size < packed.size(); ++size)
    EXPECT_NE(refusal(packed.substr(0, size)).find("damaged"), std::string::npos) << size;
  EXPECT_NE(refusal(MatWriter().doubles("t", 3, 2, {0, 1, 2}).bytes()).find("not 3 x 2"),
            std::string::npos);
  EXPECT_NE(refusal(MatWriter().doubles("t", -3, -1, {0, 1, 2}).bytes()).find("sizes"),
            std::string::npos);
  EXPECT_NE(refusal(MatWriter().doubles("a b", 3, 1, {0, 1, 2}).bytes()).find("name"),
            std::string::npos);
  EXPECT_NE(refusal(MatWriter().doubles("t", 3, 1, {0, 1, 2}).doubles("t", 1, 1, {0}).bytes())
                .find("two variables are named 't'"),
            std::string::npos);
  EXPECT_NE(refusal(MatWriter().matrix<float>("t", 3, 1, {0, 1, 2}, 8, 6).bytes())
                .find("a type that is none"),
            std::string::npos);
}

// A packed variable that says little and is much.
TEST(MatFile, APackedVariableDoesNotFillTheMemory) {
  constexpr std::size_t kTag = 8;
  const std::string zeros(std::size_t{1} << 20U, '\0');
  const std::string packed = MatWriter().packed(zeros).substr(kTag);
  EXPECT_EQ(inflated(packed, zeros.size()), zeros);
  EXPECT_THROW(static_cast<void>(inflated(packed, zeros.size() / 2)), Damage);
  EXPECT_THROW(static_cast<void>(inflated(packed, zeros.size() - 1)), Damage);
}

}  // namespace
}  // namespace kinescope::mat
