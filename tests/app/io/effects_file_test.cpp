// SPDX-License-Identifier: Apache-2.0
#include "app/io/effects_file.h"

#include <limits>

#include <gtest/gtest.h>

#include "tests/app/io/recording_folder.h"

namespace kinescope {
namespace {

using nlohmann::json;

FittedEffect eccentricity() {
  FittedEffect out;
  out.id = {"eccentricity", "joint2"};
  out.scan = 2.0;
  out.parameters = {{"sine", "rad"}, {"cosine", "rad"}};
  // Numbers without a short decimal form.
  out.values = Eigen::Vector2d(1.0 / 3.0 * 1e-3, -0.1 * 0.3);
  out.references = Eigen::Vector2d(1.0, 2.0 / 7.0);
  out.range = JointLimits{-1.0 / 3.0, 1.7};
  return out;
}

FittedEffect clock_drift() {
  FittedEffect out;
  out.id = {"clock_drift", "clock"};
  out.parameters = {{"drift", "s/s"}};
  out.values = Eigen::VectorXd::Constant(1, 5e-5);
  out.references = Eigen::VectorXd::Constant(1, 16.5);
  return out;
}

FittedEffect joint_map() {
  FittedEffect out;
  out.id = {"joint_map", "joint1"};
  out.scan = 1.0 / 3.0;
  out.table.value = Eigen::Vector3d(-0.1, 1.0 / 7.0, 2.0);
  out.table.error = Eigen::Vector3d(0.0, 1e-3 / 3.0, 0.0);
  out.table.sigma = Eigen::Vector3d(1e-5, 2e-5, 1e-5);
  return out;
}

json document_of(const std::vector<FittedEffect>& effects) {
  return {{"schema", "kinescope.calibration"},
          {"schema_version", 1},
          {"robot",
           {{"joints",
             {{{"name", "joint1"}, {"channel", "a"}, {"scale", 1.0}, {"offset", 0.0}},
              {{"name", "joint2"},
               {"channel", "b"},
               {"scale", 1e-3},
               {"offset", 0.1},
               {"couplings", {{{"channel", "a"}, {"ratio", -1.0}}}},
               {"copies", {"b_cmd"}}}}}}},
          {"gravity_base", {0.0, 0.6, -0.8}},
          {"effects", effects_json(effects)}};
}

class EffectsFile : public testing::Test {
 protected:
  [[nodiscard]] CalibratedEffects read(const std::string& text) const {
    folder_.write("calibration.json", text);
    return read_effects(folder_.path() / "calibration.json");
  }

  /// Refused, naming the file and `part`.
  void refused(const std::string& text, const std::string& part) const {
    const std::string message = folder_.refusal_of([&] { static_cast<void>(read(text)); });
    EXPECT_TRUE(message.starts_with("calibration.json: ")) << message;
    EXPECT_NE(message.find(part), std::string::npos) << message;
  }
  void refused(const json& document, const std::string& part) const {
    refused(document.dump(), part);
  }

  RecordingFolder folder_;
};

TEST_F(EffectsFile, ComesBackToTheLastBit) {
  const std::vector<FittedEffect> effects{eccentricity(), clock_drift()};
  const CalibratedEffects back = read(document_of(effects).dump(1));
  ASSERT_EQ(back.effects.size(), 2U);
  for (std::size_t i = 0; i < effects.size(); ++i) {
    EXPECT_EQ(back.effects[i].id, effects[i].id);
    EXPECT_EQ(back.effects[i].scan, effects[i].scan);
    EXPECT_EQ(back.effects[i].range, effects[i].range);
    EXPECT_EQ(back.effects[i].values, effects[i].values);
    EXPECT_EQ(back.effects[i].references, effects[i].references);
    ASSERT_EQ(back.effects[i].parameters.size(), effects[i].parameters.size());
    EXPECT_EQ(back.effects[i].parameters.back().name, effects[i].parameters.back().name);
    EXPECT_EQ(back.effects[i].parameters.back().unit, effects[i].parameters.back().unit);
  }
  ASSERT_EQ(back.channels.size(), 2U);
  EXPECT_EQ(back.channels[1].joint, "joint2");
  EXPECT_EQ(back.channels[1].channel, "b");
  EXPECT_EQ(back.channels[1].scale, 1e-3);
  EXPECT_EQ(back.channels[1].offset, 0.1);
  EXPECT_TRUE(back.channels[0].couplings.empty());
  EXPECT_TRUE(back.channels[0].copies.empty());
  EXPECT_EQ(back.channels[1].copies, std::vector<std::string>{"b_cmd"});
  EXPECT_EQ(back.channels[1].couplings, (std::vector<ChannelShare>{{"a", -1.0}}));
  ASSERT_TRUE(back.gravity_base);
  EXPECT_EQ(*back.gravity_base, Eigen::Vector3d(0.0, 0.6, -0.8));
}

// As files of earlier versions have it.
TEST_F(EffectsFile, AnEffectWithoutARangeCountsAnywhere) {
  json document = document_of({eccentricity()});
  json& effect = document["effects"][0];
  effect.erase("range");
  EXPECT_EQ(read(document.dump()).effects.at(0).range, std::nullopt);
  effect["range"] = {1.0, -1.0};
  refused(document, "'range' ends below where it begins");
  effect["range"] = {1.0};
  refused(document, "'range' is no pair of numbers");
  effect["range"] = {1.0, "far"};
  refused(document, "range is no number");
}

TEST_F(EffectsFile, AMapsTableComesBackToTheLastBit) {
  const CalibratedEffects back = read(document_of({joint_map()}).dump(1));
  ASSERT_EQ(back.effects.size(), 1U);
  EXPECT_EQ(back.effects[0].id, joint_map().id);
  EXPECT_EQ(back.effects[0].scan, joint_map().scan);
  EXPECT_EQ(back.effects[0].table.value, joint_map().table.value);
  EXPECT_EQ(back.effects[0].table.error, joint_map().table.error);
  EXPECT_EQ(back.effects[0].table.sigma, joint_map().table.sigma);
}

TEST_F(EffectsFile, AMapThatIsNoneIsRefused) {
  json document = document_of({joint_map()});
  json& table = document["effects"][0]["table"];
  table["value"][1] = 5.0;
  refused(document, "joint_map at joint1: value 3 is not above the one before");
  table["value"] = {1.0, 2.0};
  refused(document, "joint_map at joint1: columns of 2, 3 and 3 numbers");
  table["value"][1] = "far";
  refused(document, "joint_map at joint1: value 2 is no number");
  table = document_of({joint_map()})["effects"][0]["table"];
  table.erase("error");
  refused(document, "joint_map at joint1: a table without 'error'");
  document["effects"][0]["table"] = 3;
  refused(document, "joint_map at joint1");
}

TEST_F(EffectsFile, ACalibrationWithoutEffectsHasNone) {
  json document = document_of({});
  EXPECT_TRUE(read(document.dump()).effects.empty());
  document.erase("effects");
  document.erase("gravity_base");
  const CalibratedEffects back = read(document.dump());
  EXPECT_TRUE(back.effects.empty());
  EXPECT_FALSE(back.gravity_base);
}

TEST_F(EffectsFile, AnotherVersionIsRefused) {
  json document = document_of({});
  document["schema_version"] = 2;
  refused(document, "this program reads version 1 of calibrations, not 2");
  document.erase("schema_version");
  refused(document, "this program reads version 1 of calibrations, not none");
}

TEST_F(EffectsFile, WhatIsNoCalibrationIsRefused) {
  const std::string whole = document_of({eccentricity()}).dump();
  for (const std::size_t length : {whole.size() - 1, whole.size() / 2, std::size_t{0}})
    refused(whole.substr(0, length), "no calibration");
  refused(std::string("[]"), "no calibration");
  json document = document_of({eccentricity()});
  document["schema"] = "kinescope.run";
  refused(document, "no calibration");
  document["schema"] = 3;
  refused(document, "no calibration");
  document = document_of({});
  document.erase("robot");
  refused(document, "robot");
  const std::string message = folder_.refusal_of(
      [&] { static_cast<void>(read_effects(folder_.path() / "none" / "calibration.json")); });
  EXPECT_NE(message.find("none/calibration.json"), std::string::npos) << message;
}

TEST_F(EffectsFile, AMissingKeyIsNamed) {
  for (const char* key : {"effect", "place"}) {
    json document = document_of({eccentricity()});
    document["effects"][0].erase(key);
    refused(document, key);
  }
  for (const char* key : {"at", "parameters"}) {
    json document = document_of({eccentricity()});
    document["effects"][0].erase(key);
    refused(document, "eccentricity at joint2");
  }
  for (const char* key : {"name", "unit", "value", "reference"}) {
    json document = document_of({eccentricity()});
    document["effects"][0]["parameters"][1].erase(key);
    refused(document, key);
  }
  for (const char* key : {"name", "channel", "scale", "offset"}) {
    json document = document_of({eccentricity()});
    document["robot"]["joints"][1].erase(key);
    refused(document, key);
  }
}

TEST_F(EffectsFile, WhatIsNoNumberIsRefused) {
  json document = document_of({eccentricity()});
  document["effects"][0]["parameters"][0]["value"] = std::numeric_limits<double>::quiet_NaN();
  refused(document, "eccentricity at joint2: value is no number");
  refused(std::string(R"({"schema": "kinescope.calibration", "effects": [NaN]})"),
          "no calibration");
  document = document_of({eccentricity()});
  document["effects"][0]["parameters"][0]["value"] = 1e300;
  refused(document, "eccentricity at joint2: no effect has a size of 1e+300");
  document = document_of({eccentricity()});
  document["effects"][0]["at"] = "twice";
  refused(document, "eccentricity at joint2: at is no number");
  document = document_of({eccentricity()});
  document["effects"][0]["parameters"][0]["reference"] = 0.0;
  refused(document, "reference");
  document = document_of({eccentricity()});
  document["effects"] = 7;
  refused(document, "effects");
  for (const json& couplings : {json(7), json{3}, json{{{"channel", "a"}, {"ratio", "twice"}}}}) {
    document = document_of({eccentricity()});
    document["robot"]["joints"][1]["couplings"] = couplings;
    refused(document, "");
  }
  for (const json& copies : {json(7), json{3}}) {
    document = document_of({eccentricity()});
    document["robot"]["joints"][1]["copies"] = copies;
    refused(document, "cop");
  }
  for (const json& gravity : {json{0.0, 1.0}, json{0.0, nullptr, 1.0}, json("down")}) {
    document = document_of({eccentricity()});
    document["gravity_base"] = gravity;
    refused(document, "gravity_base");
  }
}

}  // namespace
}  // namespace kinescope
