// SPDX-License-Identifier: Apache-2.0
//
// `kinescope contact` as a user meets it: contacts found in a log, products, refusals.
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "kinematics/urdf/dynamic_urdf.h"
#include "tests/app/commands/program.h"
#include "tests/app/commands/torque_log_text.h"
#include "tests/app/io/check_products.h"
#include "tests/app/io/recording_folder.h"
#include "tests/truth/contact_world.h"

namespace kinescope {
namespace {

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

  RecordingFolder folder_;
  ContactWorld free_, touched_;
};

/// The same with motor currents in place of torques.
std::string currents(TorqueSamples samples) {
  samples.torque = samples.torque * Eigen::Vector3d(0.1, 0.08, 0.13).asDiagonal();
  std::string text = torque_log_csv(samples);
  for (std::size_t at = text.find("tau"); at != std::string::npos; at = text.find("tau", at)) {
    text.replace(at, 3, "i");
  }
  return text;
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

TEST_F(ContactCommand, AnOffsetOfASensorIsNoContact) {
  TorqueSamples shifted = touched_.samples;
  shifted.torque.col(0).array() += 20.0;  // N m
  folder_.write("log.csv", torque_log_csv(shifted));
  const Outcome outcome = run(words());
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  EXPECT_TRUE(outcome.out.starts_with("3 contacts")) << outcome.out;
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
