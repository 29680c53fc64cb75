// SPDX-License-Identifier: Apache-2.0
//
// Simulated logs of others with their exact torques: our torque from their motion.
#include <gtest/gtest.h>

#include "dynamics/rigid/inverse_dynamics.h"
#include "kinematics/urdf/dynamic_urdf.h"
#include "tests/truth/gzip_table.h"
#include "tests/truth/shared_data.h"

namespace kinescope {
namespace {

struct SyntheticLog {
  const char* folder;
  int joints;
};

class SyntheticLogs : public testing::TestWithParam<SyntheticLog> {};

TEST_P(SyntheticLogs, TheTorqueIsTheirsUpToTheirRounding) {
  const auto folder = shared_data(std::string("synthetic_dynamics/") + GetParam().folder);
  if (!folder) GTEST_SKIP() << "shared data is not on this machine";
  const int n = GetParam().joints;
  DynamicModel model = read_dynamic_urdf(*folder / "nominal.urdf");
  model.gravity_m_s2 = {0.0, 0.0, -9.81};  // as their README says
  const CsvTable log = read_gzip_csv(*folder / "log.csv.gz");
  const CsvTable truth = read_gzip_csv(*folder / "truth_log.csv.gz");
  // The truth holds every fifth sample of the log. Rates of the log are noisy (1e-3), positions
  // rounded to 5e-5 rad and all is printed with 5 digits; their torque sigma is 0.5 % of the
  // joint's rms.
  const Eigen::MatrixXd q = numbered_columns(log, "q", n, 5);
  const Eigen::MatrixXd dq = numbered_columns(log, "dq", n, 5);
  const Eigen::MatrixXd ddq = numbered_columns(truth, "ddq", n);
  const Eigen::MatrixXd theirs = numbered_columns(truth, "tau_nominal", n);
  ASSERT_EQ(q.rows(), theirs.rows());
  const Eigen::MatrixXd ours = inverse_dynamics_of_samples(make_rigid_model(model), q, dq, ddq);
  for (int j = 0; j < n; ++j) {
    const double rms = theirs.col(j).norm();
    EXPECT_LT((ours.col(j) - theirs.col(j)).norm(), 0.005 * rms) << "joint " << j + 1;
  }
}

INSTANTIATE_TEST_SUITE_P(All, SyntheticLogs,
                         testing::Values(SyntheticLog{"scara4_none", 4},
                                         SyntheticLog{"ur6_contact", 6},
                                         SyntheticLog{"wam7_payload", 7},
                                         SyntheticLog{"wam7_coulomb_viscous", 7}),
                         [](const auto& log) { return std::string(log.param.folder); });

}  // namespace
}  // namespace kinescope
