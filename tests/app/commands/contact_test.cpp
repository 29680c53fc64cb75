// SPDX-License-Identifier: Apache-2.0
//
// `kinescope contact` as a user meets it: contacts found in a log, by the momentum balance or by a
// torque model, products, refusals.
#include <algorithm>

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "dynamics/experiments/contact_world.h"
#include "dynamics/rigid/inverse_dynamics.h"
#include "kinematics/urdf/dynamic_urdf.h"
#include "tests/app/commands/program.h"
#include "tests/app/commands/torque_log_text.h"
#include "tests/app/io/check_products.h"
#include "tests/app/io/recording_folder.h"
#include "tests/truth/shared_data.h"

namespace kinescope {
namespace {

using namespace experiments;

class ContactCommand : public testing::Test {
 protected:
  ContactCommand() {
    const DynamicModel model = contact_arm(3);
    Rng rng = Rng::from_name("contact command");
    free_ = contact_world(model, {.duration_s = 10.0}, rng);
    touched_ = contact_world(model, {.duration_s = 8.0, .contacts = 3}, rng);
    folder_.write("free.csv", torque_log_csv(free_.samples))
        .write("log.csv", torque_log_csv(touched_.samples))
        .write("robot.urdf", write_urdf(model));
  }
  [[nodiscard]] std::string path(const char* name) const {
    return (folder_.path() / name).string();
  }
  [[nodiscard]] std::vector<std::string> words(const std::vector<std::string>& more = {}) const {
    std::vector<std::string> out{"contact",  path("log.csv"), "--robot", path("robot.urdf"),
                                 "--output", path("out"),     "--quiet"};
    out.insert(out.end(), more.begin(), more.end());
    return out;
  }

  [[nodiscard]] nlohmann::json contacts() const {
    return nlohmann::json::parse(read_text_file(folder_.path() / "out/contacts.json"));
  }
  void expect_labelled(const nlohmann::json& found) const {
    constexpr double kOnset = 0.05;  // s
    ASSERT_EQ(found.size(), touched_.labels.size());
    for (std::size_t k = 0; k < found.size(); ++k) {
      EXPECT_NEAR(found[k].at("onset_s").get<double>(), touched_.labels[k].begin_s, kOnset);
    }
  }
  /// A model of the free log, saved.
  [[nodiscard]] std::string saved_model() const {
    const Outcome outcome = run({"dynamics", path("free.csv"), "--robot", path("robot.urdf"),
                                 "--model", "parametric", "--no-trace", "--save-model",
                                 path("torque.json"), "--output", path("model"), "--quiet"});
    EXPECT_EQ(outcome.code, 0) << outcome.err;
    return path("torque.json");
  }

  RecordingFolder folder_;
  ContactWorld free_, touched_;
};

/// Something of half a kilogram hangs at the last link from an instant on.
TorqueSamples picked_up(const DynamicModel& model, TorqueSamples samples, double from_s) {
  DynamicModel loaded = model;
  loaded.links.back() += from_central(
      {.mass_kg = 0.5, .centre_m = {0.02, 0.03, 0.1}, .inertia_kgm2 = Eigen::Matrix3d::Zero()});
  const Eigen::MatrixXd still = Eigen::MatrixXd::Zero(samples.size(), samples.joints());
  const Eigen::MatrixXd more =
      inverse_dynamics_of_samples(make_rigid_model(loaded), samples.q, still, still) -
      inverse_dynamics_of_samples(make_rigid_model(model), samples.q, still, still);
  for (Eigen::Index k = 0; k < samples.size(); ++k) {
    if (samples.t_s[k] >= from_s) samples.torque.row(k) += more.row(k);
  }
  return samples;
}

/// It lasts for half of the log, which friction, offsets and noise are learned from: by the masses
/// of the URDF, identified ones, and a torque model.
TEST_F(ContactCommand, ALoadThatIsPickedUpIsOneContact) {
  const DynamicModel model = contact_arm(3);
  Rng rng = Rng::from_name("contact command load");
  const ContactWorld world = contact_world(model, {.duration_s = 24.0}, rng);
  folder_.write("log.csv", torque_log_csv(picked_up(model, world.samples, 13.0)));
  for (const std::vector<std::string>& how :
       {std::vector<std::string>{}, {"--identify"}, {"--model", "parametric"}}) {
    const Outcome outcome = run(words(how));
    ASSERT_EQ(outcome.code, 0) << outcome.err;
    const nlohmann::json found = contacts().at("contacts");
    ASSERT_EQ(found.size(), 1U) << outcome.out;
    EXPECT_NEAR(found[0].at("onset_s").get<double>(), 13.0, 0.1);
    EXPECT_NEAR(found[0].at("end_s").get<double>(), 24.0, 0.1);
    EXPECT_EQ(found[0].at("link"), "link3");
    std::filesystem::remove_all(folder_.path() / "out");
  }
}

/// The same with motor currents in place of torques.
std::string currents(TorqueSamples samples) {
  samples.torque = samples.torque * Eigen::Vector3d(0.1, 0.08, 0.13).asDiagonal();
  std::string text = torque_log_csv(samples);
  for (std::size_t at = text.find("tau"); at != std::string::npos; at = text.find("tau", at)) {
    text.replace(at, 3, "i");
  }
  return text;
}

TEST_F(ContactCommand, ADeadTorqueChannelIsLeftOutAndNamed) {
  TorqueSamples samples = touched_.samples;
  samples.torque.col(1).setConstant(0.3);
  folder_.write("log.csv", torque_log_csv(samples));
  for (const std::vector<std::string>& masses : {std::vector<std::string>{}, {"--identify"}}) {
    const Outcome outcome = run(words(masses));
    ASSERT_EQ(outcome.code, 0) << outcome.err;
    EXPECT_NE(outcome.out.find("at joint2, whose torque never changes and was left out"),
              std::string::npos)
        << outcome.out;
    const nlohmann::json found = contacts();
    EXPECT_EQ(found.at("unfit"), nlohmann::json::array({"joint2"}));
    EXPECT_LE(found.at("contacts").size(), touched_.labels.size());
    std::filesystem::remove_all(folder_.path() / "out");
  }
}

/// The first second and a half of the samples outside the labels, in which the joint turns fast.
Eigen::Index calm_row(const ContactWorld& world, Eigen::Index joint, double span_s) {
  constexpr double kApart_s = 0.5;
  for (Eigen::Index row = 0; row < world.samples.size(); ++row) {
    const double t = world.samples.t_s[row];
    const bool calm = std::ranges::none_of(world.labels, [&](const auto& label) {
      return label.begin_s < t + span_s + kApart_s && label.end_s > t - kApart_s;
    });
    if (calm && t > 1.0 && std::abs(world.samples.dq(row, joint)) > 0.3) return row;
  }
  return 0;
}

TEST_F(ContactCommand, ATorqueThatFreezesIsNamedAndNoContact) {
  constexpr double kSpan_s = 0.5;
  TorqueSamples samples = touched_.samples;
  const Eigen::Index row = calm_row(touched_, 1, kSpan_s);
  ASSERT_GT(row, 0);
  const auto rows = static_cast<Eigen::Index>(kSpan_s / (samples.t_s[1] - samples.t_s[0]));
  samples.torque.col(1).segment(row, rows).setConstant(samples.torque(row, 1));
  folder_.write("log.csv", torque_log_csv(samples));
  for (const std::vector<std::string>& model :
       {std::vector<std::string>{"--learn", path("free.csv")}, {"--model", "parametric"}}) {
    const Outcome outcome = run(words(model));
    ASSERT_EQ(outcome.code, 0) << outcome.err;
    EXPECT_NE(outcome.err.find("column 'tau2' keeps the value"), std::string::npos) << outcome.err;
    expect_labelled(contacts().at("contacts"));
    std::filesystem::remove_all(folder_.path() / "out");
  }
}

// A blow that takes a torque to its limit says that it is at least so large.
TEST_F(ContactCommand, ContactsThatReachALimitAreFound) {
  constexpr double kApart_s = 0.5;
  TorqueSamples samples = touched_.samples;
  Eigen::VectorXd limit = Eigen::VectorXd::Zero(samples.joints());
  for (Eigen::Index row = 0; row < samples.size(); ++row) {
    const double t = samples.t_s[row];
    const bool calm = std::ranges::none_of(touched_.labels, [&](const auto& label) {
      return label.begin_s < t + kApart_s && label.end_s > t - kApart_s;
    });
    if (calm) limit = limit.cwiseMax(samples.torque.row(row).transpose().cwiseAbs());
  }
  for (Eigen::Index j = 0; j < samples.joints(); ++j)
    samples.torque.col(j) = samples.torque.col(j).cwiseMax(-limit[j]).cwiseMin(limit[j]);
  folder_.write("log.csv", torque_log_csv(samples));
  const Outcome outcome = run(words({"--learn", path("free.csv")}));
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  EXPECT_NE(outcome.err.find("is cut off at"), std::string::npos) << outcome.err;
  expect_labelled(contacts().at("contacts"));
}

TEST_F(ContactCommand, WildReadingsAreNoContacts) {
  TorqueSamples samples = touched_.samples;
  const double largest = 2.0 * samples.torque.col(1).cwiseAbs().maxCoeff();
  Rng rng = Rng::from_name("wild readings");
  for (double& torque : samples.torque.col(1)) {
    if (rng.uniform() < 0.05) torque = rng.uniform(-largest, largest);
  }
  folder_.write("log.csv", torque_log_csv(samples));
  const Outcome outcome = run(words({"--learn", path("free.csv")}));
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  EXPECT_NE(outcome.err.find("jumps and comes back"), std::string::npos) << outcome.err;
  expect_labelled(contacts().at("contacts"));
}

TEST_F(ContactCommand, FindsEveryContactAndInventsNone) {
  const Outcome outcome = run(words({"--learn", path("free.csv")}));
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  const auto document = nlohmann::json::parse(read_text_file(folder_.path() / "out/contacts.json"));
  const auto& contacts = document.at("contacts");
  ASSERT_EQ(contacts.size(), touched_.labels.size());
  for (std::size_t k = 0; k < contacts.size(); ++k) {
    constexpr double kOnset = 0.05;  // s
    EXPECT_NEAR(contacts[k].at("onset_s").get<double>(), touched_.labels[k].begin_s, kOnset);
  }
  EXPECT_TRUE(read_text_file(folder_.path() / "out/contacts.csv").starts_with("onset_s,end_s"));
  EXPECT_NE(read_text_file(folder_.path() / "out/contact.html").find("Contact time line"),
            std::string::npos);
  const ProductCheck check = check_products(folder_.path() / "out");
  EXPECT_TRUE(check.passed || !check.done) << check.words;
}

TEST_F(ContactCommand, LearnsFromTheLogItself) {
  const Outcome outcome = run(words());
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  EXPECT_TRUE(outcome.out.starts_with("3 contacts")) << outcome.out;
}

TEST_F(ContactCommand, EveryLogHasAClockOfItsOwn) {
  folder_.write("again.csv", read_text_file(folder_.path() / "log.csv"));
  std::vector<std::string> both = words();
  both.insert(both.begin() + 2, path("again.csv"));
  const Outcome outcome = run(both);
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  const auto document = nlohmann::json::parse(read_text_file(folder_.path() / "out/contacts.json"));
  const auto& contacts = document.at("contacts");
  const std::size_t one = touched_.labels.size();
  ASSERT_EQ(contacts.size(), 2 * one) << outcome.out;
  for (std::size_t k = 0; k < contacts.size(); ++k) {
    constexpr double kOnset = 0.05;  // s
    EXPECT_EQ(contacts[k].at("trajectory"), k < one ? "log.csv" : "again.csv");
    EXPECT_NEAR(contacts[k].at("onset_s").get<double>(), touched_.labels[k % one].begin_s, kOnset);
  }
  EXPECT_NE(read_text_file(folder_.path() / "out/contacts.csv").find(",again.csv,"),
            std::string::npos);
  const std::string page = read_text_file(folder_.path() / "out/contact.html");
  EXPECT_NE(page.find("again.csv from "), std::string::npos);
  const ProductCheck check = check_products(folder_.path() / "out");
  EXPECT_TRUE(check.passed || !check.done) << check.words;
}

TEST_F(ContactCommand, CurrentsAreNotHeldAgainstMasses) {
  folder_.write("free.csv", currents(free_.samples)).write("log.csv", currents(touched_.samples));
  const Outcome outcome = run(words({"--learn", path("free.csv")}));
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  EXPECT_TRUE(outcome.out.starts_with("3 contacts")) << outcome.out;
  const auto document = nlohmann::json::parse(read_text_file(folder_.path() / "out/contacts.json"));
  EXPECT_EQ(document.at("unit"), "A");
  EXPECT_TRUE(document.at("model").get<std::string>().starts_with("identified"));
  folder_.write("free.csv", torque_log_csv(free_.samples));
  expect_refusal(words({"--learn", path("free.csv")}), ExitCode::kBadInput, "is in Nm");
}

TEST_F(ContactCommand, TorquesThatAreNotTheMassesAreRefused) {
  TorqueSamples turned = touched_.samples;
  turned.torque *= -1.0;
  folder_.write("log.csv", torque_log_csv(turned));
  expect_refusal(words(), ExitCode::kBadInput, "other sign");
}

// Columns of another joint: nothing that the thresholds of such a model exclude is known.
TEST_F(ContactCommand, JointsThatTheModelSaysNothingOfAreNamed) {
  TorqueSamples exchanged = touched_.samples;
  exchanged.torque.col(1).swap(exchanged.torque.col(2));
  folder_.write("log.csv", torque_log_csv(exchanged));
  const Outcome outcome = run(words({"--learn", path("free.csv")}));
  EXPECT_NE(outcome.out.find("Nothing is known of contact at"), std::string::npos)
      << outcome.out << outcome.err;
  EXPECT_FALSE(contacts().at("unfit").empty());
  folder_.write("log.csv", torque_log_csv(touched_.samples));
  ASSERT_EQ(run(words({"--learn", path("free.csv")})).code, 0);
  EXPECT_TRUE(contacts().at("unfit").empty());
}

TEST_F(ContactCommand, AnOffsetOfASensorIsNoContact) {
  TorqueSamples shifted = touched_.samples;
  shifted.torque.col(0).array() += 20.0;  // N m
  folder_.write("log.csv", torque_log_csv(shifted));
  const Outcome outcome = run(words());
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  EXPECT_TRUE(outcome.out.starts_with("3 contacts")) << outcome.out;
}

TEST_F(ContactCommand, ASavedModelServesBesideTheMomentumBalance) {
  const Outcome outcome = run(words({"--learn", path("free.csv"), "--model", saved_model()}));
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  EXPECT_TRUE(outcome.out.starts_with("By what the parametric model does not predict: 3 contacts"))
      << outcome.out;
  EXPECT_NE(outcome.out.find("3 contacts; 3 of the above are among them"), std::string::npos)
      << outcome.out;
  const nlohmann::json document = contacts();
  EXPECT_EQ(document.at("method"), "parametric");
  EXPECT_NE(document.at("model").get<std::string>().find("torque.json"), std::string::npos);
  expect_labelled(document.at("contacts"));
  expect_labelled(document.at("momentum").at("contacts"));
  EXPECT_EQ(document.at("inputs").back().at("name"), "torque.json");
  EXPECT_NE(read_text_file(folder_.path() / "out/contact.html").find("Contacts by both"),
            std::string::npos);
  const ProductCheck check = check_products(folder_.path() / "out");
  EXPECT_TRUE(check.passed || !check.done) << check.words;
}

TEST_F(ContactCommand, AModelIsLearnedOnTheSpotTheSameEachTime) {
  const std::vector<std::string> learned = words({"--model", "semi_parametric", "--force"});
  const Outcome outcome = run(learned);
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  expect_labelled(contacts().at("contacts"));
  const std::string first = read_text_file(folder_.path() / "out/contacts.json");
  EXPECT_EQ(run(learned).code, 0);
  EXPECT_EQ(read_text_file(folder_.path() / "out/contacts.json"), first);
}

TEST_F(ContactCommand, CurrentsNeedNoMassesWithAModel) {
  folder_.write("free.csv", currents(free_.samples)).write("log.csv", currents(touched_.samples));
  const Outcome outcome = run(words({"--learn", path("free.csv"), "--model", saved_model()}));
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  EXPECT_EQ(contacts().at("unit"), "A");
  expect_labelled(contacts().at("contacts"));
}

TEST_F(ContactCommand, ModelsThatDoNotFitAreRefusedBeforeTheWork) {
  const std::string model = saved_model();
  const auto refused = [&](const std::string& name, ExitCode code, const char* part) {
    expect_refusal(words({"--model", name}), code, part);
    EXPECT_FALSE(std::filesystem::exists(folder_.path() / "out/contacts.json"));
  };
  refused("svr", ExitCode::kBadRequest, "svr models cannot be saved, nor be used here");
  refused(path("none.json"), ExitCode::kBadInput, "none.json: there is no such file");
  refused(path("log.csv"), ExitCode::kBadInput, "log.csv: this is no JSON");
  expect_refusal(words({"--model", model, "--identify"}), ExitCode::kBadRequest,
                 "contradicts --model");
  expect_refusal(words({"--model", model, "--cutoff", "3.5"}), ExitCode::kBadRequest,
                 "is 3.5 Hz, " + model + " was learned behind");
  const DynamicModel arm = contact_arm(3);
  DynamicModel longer = arm;
  longer.tree.joints.back().T_parent_joint.translation.x() += 1e-3;  // m
  folder_.write("robot.urdf", write_urdf(longer));
  refused(model, ExitCode::kBadInput, "is another one, or elsewhere, in robot.urdf");
  folder_.write("robot.urdf", write_urdf(arm));
  const std::string whole = read_text_file(model);
  auto document = nlohmann::json::parse(whole);
  document["robot"] = "another";
  folder_.write("torque.json", document.dump());
  refused(model, ExitCode::kBadInput, "is of robot 'another'");
  folder_.write("torque.json", whole).write("robot.urdf", write_urdf(contact_arm(2)));
  refused(model, ExitCode::kBadInput, "has the joints");
  folder_.write("robot.urdf", write_urdf(contact_arm(3)))
      .write("log.csv", currents(touched_.samples));
  refused(model, ExitCode::kBadInput, "its torques are in A, the model's in Nm");
}

/// Eleven seconds of a UR5's base in motion, against an obstacle and held there.
TEST_F(ContactCommand, AMeasuredContactThatIsHeldIsReportedOnce) {
  const auto log = shared_data("dynamics/ur5_contact/impact_4degps_1.csv");
  if (!log) GTEST_SKIP() << "shared data dynamics/ur5_contact is not on this machine";
  folder_.write("base.urdf", R"(<robot name="base"><link name="base"/><link name="link1"/>
<joint name="joint1" type="continuous"><parent link="base"/><child link="link1"/>
<axis xyz="0 0 1"/></joint></robot>)");
  for (const std::vector<std::string>& more :
       {std::vector<std::string>{}, std::vector<std::string>{"--model", "gip"}}) {
    std::vector<std::string> all{"contact",  log->string(), "--robot", path("base.urdf"),
                                 "--output", path("out"),   "--quiet", "--force"};
    all.insert(all.end(), more.begin(), more.end());
    const Outcome outcome = run(all);
    ASSERT_EQ(outcome.code, 0) << outcome.err;
    const nlohmann::json found = contacts().at("contacts");
    ASSERT_EQ(found.size(), 1U) << outcome.out;
    EXPECT_GT(found[0].at("onset_s").get<double>(), 8.04);  // the obstacle's place
    EXPECT_GT(found[0].at("end_s").get<double>(), 11.4);    // the end of the log
  }
}

TEST_F(ContactCommand, RefusesWhatCannotBe) {
  expect_refusal(words({"--false-alarms", "0"}), ExitCode::kBadRequest, "0");
  TorqueSamples without = touched_.samples;
  without.torque.resize(without.size(), 0);
  folder_.write("log.csv", torque_log_csv(without));
  expect_refusal(words(), ExitCode::kBadInput, "torque");
}

}  // namespace
}  // namespace kinescope
