// SPDX-License-Identifier: Apache-2.0
//
// `kinescope run` on a recording with torque columns: from corners to torque model and contacts in
// one go, with the robot that it learned itself.
#include <fmt/format.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "app/io/products.h"
#include "calib/camera/camera_file.h"
#include "dynamics/rigid/inverse_dynamics.h"
#include "tests/app/commands/program.h"
#include "tests/app/io/check_products.h"
#include "tests/app/io/recording_folder.h"
#include "tests/truth/camera_world.h"
#include "tests/truth/random_dynamics.h"

namespace kinescope {
namespace {

constexpr double kNoise = 0.002;  // of the torque, share of each joint's rms

// Central differences of a log sampled evenly.
Eigen::MatrixXd rate_of(const Eigen::MatrixXd& values, double step_s) {
  Eigen::MatrixXd out = Eigen::MatrixXd::Zero(values.rows(), values.cols());
  for (Eigen::Index i = 1; i + 1 < values.rows(); ++i) {
    out.row(i) = (values.row(i + 1) - values.row(i - 1)) / (2.0 * step_s);
  }
  return out;
}

std::string joints_csv(const truth::World& world, const Eigen::MatrixXd& torque) {
  std::string text = "t";
  for (const std::string& channel : world.log.channels) text += "," + channel;
  for (const std::string& channel : world.log.channels) text += ",tau_" + channel;
  text += "\n";
  for (Eigen::Index i = 2; i + 2 < world.log.values.rows(); ++i) {
    text += fmt::format("{}", world.log.times_s[static_cast<std::size_t>(i)]);
    for (Eigen::Index j = 0; j < world.log.values.cols(); ++j) {
      text += fmt::format(",{}", world.log.values(i, j));
    }
    for (Eigen::Index j = 0; j < torque.cols(); ++j) text += fmt::format(",{}", torque(i, j));
    text += "\n";
  }
  return text;
}

TEST(RunTorque, FromCornersToTorqueModelAndContacts) {
  truth::WorldOptions options;
  options.frames = 600;
  options.link_length_m = 0.2;
  const truth::World world = truth::make_world(options);
  Rng rng = Rng::from_name("run torque");
  const DynamicModel model = random_masses(world.tree, {}, rng);
  const double step_s = 1.0 / options.log_rate_hz;
  const Eigen::MatrixXd dq = rate_of(world.log.values, step_s);
  Eigen::MatrixXd torque = inverse_dynamics_of_samples(make_rigid_model(model), world.log.values,
                                                       dq, rate_of(dq, step_s));
  for (Eigen::Index j = 0; j < torque.cols(); ++j) {
    const double rms = std::sqrt(torque.col(j).squaredNorm() / static_cast<double>(torque.rows()));
    for (double& value : torque.col(j)) value += rng.normal(kNoise * rms);
  }

  TagObservations seen;
  seen.times_s = world.measurements.times_s;
  seen.width = world.camera.width;
  seen.height = world.camera.height;
  seen.observations = world.measurements.corners;
  const Eigen::Vector3d gravity = world.T_camera_base.rotation * model.gravity_m_s2;
  const RecordingFolder folder;
  folder.write("corners.csv", observations_csv(seen))
      .write("camera.yaml", write_camera_info(world.camera))
      .write("tags.yaml", fmt::format("default_size: {}\n", options.tag_size_m))
      .write("recording.yaml",
             fmt::format("gravity: [{}, {}, {}]\n", gravity.x(), gravity.y(), gravity.z()))
      .write("joints.csv", joints_csv(world, torque));
  const std::string output = (folder.path() / "out").string();
  const Outcome outcome = run({"run", folder.path().string(), "--output", output, "--quiet"});
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  EXPECT_NE(outcome.out.find("Contacts: No contact"), std::string::npos) << outcome.out;
  const auto document = nlohmann::json::parse(read_text_file(folder.path() / "out/dynamics.json"));
  for (const auto& score : document.at("models")) {
    if (score.at("model") != "parametric") continue;
    for (const auto& nmse : score.at("nmse_percent")) EXPECT_LT(nmse.get<double>(), 1.0);
  }
  for (const char* product : {"robot.urdf", "robot_dynamics.urdf", "contacts.csv", "contact.html",
                              "dynamics.html", "report.html"}) {
    EXPECT_TRUE(std::filesystem::exists(folder.path() / "out" / product)) << product;
  }
  EXPECT_NE(read_text_file(folder.path() / "out/report.html").find("Torques and contacts"),
            std::string::npos);

  EXPECT_TRUE(document.at("gravity_declared"));

  // The base's z is the normal of its marker, which hangs on no level wall.
  folder.remove("recording.yaml");
  const std::string undeclared = (folder.path() / "undeclared").string();
  const Outcome again =
      run({"run", folder.path().string(), "--output", undeclared, "--quiet", "--no-trace"});
  ASSERT_EQ(again.code, 0) << again.err;
  EXPECT_NE(again.out.find("the torques say that it points along"), std::string::npos) << again.out;
  const auto found = nlohmann::json::parse(read_text_file(undeclared + "/dynamics.json"));
  EXPECT_FALSE(found.at("gravity_declared"));
  for (const auto& score : found.at("models")) {
    if (score.at("model") != "parametric") continue;
    for (const auto& nmse : score.at("nmse_percent")) EXPECT_LT(nmse.get<double>(), 1.0);
  }

  const ProductCheck check = check_products(folder.path() / "out");
  if (!check.done) GTEST_SKIP() << "the files' schemas were not checked: " << check.words;
  EXPECT_TRUE(check.passed) << check.words;
  for (const char* product :
       {"structure.json", "calibration.json", "trace.json", "result.json", "run.json",
        "dynamics.json", "dynamics_trace.json", "contacts.json"}) {
    EXPECT_NE(check.words.find(std::string(product) + ": valid"), std::string::npos) << product;
  }
  auto misspelt = nlohmann::json::parse(read_text_file(folder.path() / "out/trace.json"));
  misspelt["verdikt"] = misspelt.at("verdict");
  misspelt.erase("verdict");
  folder.write("out/trace.json", misspelt.dump());
  const ProductCheck misspelt_check = check_products(folder.path() / "out");
  EXPECT_FALSE(misspelt_check.passed);
  EXPECT_NE(misspelt_check.words.find("verdikt"), std::string::npos) << misspelt_check.words;
}

}  // namespace
}  // namespace kinescope
