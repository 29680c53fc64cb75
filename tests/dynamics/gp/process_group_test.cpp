// SPDX-License-Identifier: Apache-2.0
//
// The dense route over the processes of mpirun (tests/experiments/exact_gp.cpp): mean, band and log
// likelihood are one process's to 1e-8.
#include "dynamics/gp/process_group.h"

#include <cstdio>
#include <cstdlib>
#include <string>

#include <gtest/gtest.h>

#include "kinematics/core/error.h"

namespace kinescope::gp {
namespace {

bool installed(const std::string& program) {
  return std::system(("command -v " + program + " > /dev/null").c_str()) == 0;
}

class Processes : public testing::TestWithParam<int> {};

// Six blocks a side for two and for four processes, the last one smaller.
TEST_P(Processes, GiveTheAnswersOfOne) {
  if (!KINESCOPE_WITH_SCALAPACK) GTEST_SKIP() << "built without ScaLAPACK (KINESCOPE_SCALAPACK)";
  if (!installed("mpirun")) GTEST_SKIP() << "mpirun is not installed (openmpi-bin)";
  const std::string command = "mpirun --oversubscribe --allow-run-as-root -n " +
                              std::to_string(GetParam()) + " " KINESCOPE_EXACT_GP +
                              " --samples 1400 --no-dpotrf --against-one --threads 1";
  EXPECT_EQ(std::system(command.c_str()), 0) << command;
}

// A matrix of 16 MB in 10: on one machine it does not fit, half of it on either of two does.
TEST(ProcessGroup, EachMachineNeedsMemoryForItsShare) {
  if (!KINESCOPE_WITH_SCALAPACK) GTEST_SKIP() << "built without ScaLAPACK (KINESCOPE_SCALAPACK)";
  if (!installed("mpirun")) GTEST_SKIP() << "mpirun is not installed (openmpi-bin)";
  const auto fits = [](const std::string& machine) {
    return std::system(("mpirun --oversubscribe --allow-run-as-root -n 2 " + machine +
                        KINESCOPE_EXACT_GP " --samples 1400 --no-dpotrf --threads 1 --most-mb 10")
                           .c_str()) == 0;
  };
  EXPECT_FALSE(fits(""));
  EXPECT_TRUE(fits("env OMPI_COMM_WORLD_LOCAL_SIZE=1 "));
}

INSTANTIATE_TEST_SUITE_P(TwoAndFour, Processes, testing::Values(2, 4));

TEST(ProcessGroup, WithoutMpirunThereIsOne) {
  const ProcessGroup alone;
  EXPECT_EQ(process_count(), 1);
  EXPECT_EQ(process_rank(), 0);
}

// What the program has held at most, and the 0.128 GB of one matrix of 4000 samples.
TEST(Fit, KeepsOneKernelMatrix) {
  constexpr double kMatrix_gb = 0.128;
  constexpr double kTwo = 2.0 * kMatrix_gb;
  std::FILE* out = popen(KINESCOPE_EXACT_GP " --samples 4000 --no-dpotrf --threads 2", "r");
  ASSERT_NE(out, nullptr);
  std::string words(300, '\0');
  words.resize(std::fread(words.data(), 1, words.size(), out));
  ASSERT_EQ(pclose(out), 0) << words;
  const std::size_t at = words.find("peak ");
  ASSERT_NE(at, std::string::npos) << words;
  const double peak_gb = std::stod(words.substr(at + 5));
  EXPECT_GT(peak_gb, kMatrix_gb);
  EXPECT_LT(peak_gb, kTwo);
}

TEST(ProcessGroup, ABuildForOneProcessRefusesSeveral) {
  if (KINESCOPE_WITH_SCALAPACK) GTEST_SKIP() << "built with ScaLAPACK";
  setenv("OMPI_COMM_WORLD_SIZE", "2", 1);
  EXPECT_THROW(ProcessGroup(), Error);
  unsetenv("OMPI_COMM_WORLD_SIZE");
}

}  // namespace
}  // namespace kinescope::gp
