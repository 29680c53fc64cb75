// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include "tests/app/io/recording_folder.h"
#include "tests/truth/shared_data.h"

namespace kinescope {
namespace {

class TagsYaml : public testing::Test {
 protected:
  MarkerSet read(std::string_view text) {
    folder_.write("tags.yaml", text);
    return read_marker_set(folder_.path() / "tags.yaml");
  }
  std::string refusal(std::string_view text) {
    return folder_.refusal_of([&] { static_cast<void>(read(text)); });
  }
  RecordingFolder folder_;
};

TEST_F(TagsYaml, FamilyDefaultAndSizes) {
  const MarkerSet markers =
      read("family: tag25h9\ndefault_size: 0.06 # m\nsizes:\n  12: 0.09\n  0: 5e-2\n");
  EXPECT_EQ(markers.family, "tag25h9");
  EXPECT_EQ(markers.size_m(TagId{12}), 0.09);
  EXPECT_EQ(markers.size_m(TagId{0}), 0.05);
  EXPECT_EQ(markers.size_m(TagId{3}), 0.06);
  EXPECT_FALSE(markers.only_listed);
}

TEST_F(TagsYaml, ListOfTagsWithoutADefaultKnowsOnlyThose) {
  const MarkerSet markers = read("tags:\n  - {id: 3, size: 0.04}\n  - {id: 4, size: 0.05}\n");
  EXPECT_EQ(markers.family, "tag36h11");
  EXPECT_EQ(markers.size_m(TagId{4}), 0.05);
  EXPECT_EQ(markers.size_m(TagId{5}), 0.0);
  EXPECT_TRUE(markers.only_listed);
  EXPECT_FALSE(read("only_listed: false\ntags: [{id: 3, size: 0.04}]").only_listed);
  EXPECT_TRUE(read("only_listed: true\ndefault_size: 0.05\ntags: [{id: 3}]").only_listed);
  EXPECT_EQ(markers.sizes_m.size(), 2U);
}

TEST_F(TagsYaml, ArucoDictionariesAreFamilies) {
  EXPECT_EQ(read("family: DICT_6X6_250\ndefault_size: 0.1\n").family, "DICT_6X6_250");
}

TEST_F(TagsYaml, BoardsGiveTheirCornersRowByRow) {
  const MarkerSet markers = read("boards:\n  7: {columns: 3, rows: 2, square: 0.02}\n");
  const std::vector<Eigen::Vector3d> corners = markers.corners_m(TagId{7});
  ASSERT_EQ(corners.size(), 6U);
  EXPECT_EQ(corners[0], Eigen::Vector3d(0, 0, 0));
  EXPECT_EQ(corners[1], Eigen::Vector3d(0.02, 0, 0)) << "x to the right";
  EXPECT_EQ(corners[3], Eigen::Vector3d(0, 0.02, 0)) << "y down";
}

TEST_F(TagsYaml, RefusesWrongSizes) {
  for (const char* size : {"0", "-0.05", ".nan", "nan", ".inf", "big", "", "[0.05]"}) {
    const std::string message =
        refusal(std::string("family: tag36h11\ndefault_size: ") + size + "\n");
    EXPECT_TRUE(message.starts_with("tags.yaml:2: default_size is ")) << size << ": " << message;
  }
  EXPECT_EQ(
      refusal("sizes:\n  12: 0\n"),
      "tags.yaml:2: sizes.12 is 0, not above zero (give the edge of the black square in m, as "
      "measured)");
  EXPECT_EQ(refusal("default_size: 60\n"),
            "tags.yaml:1: default_size is 60 m, larger than 5 m (sizes are in m; was this mm?)");
  EXPECT_NE(refusal("tags:\n - {id: 3}\n").find("tags.yaml:2: tags.0 gives marker 3 no size"),
            std::string::npos);
  EXPECT_NE(refusal("tags:\n - {size: 0.1}\n").find("tags.yaml:2: tags.0 has no 'id'"),
            std::string::npos);
  EXPECT_EQ(refusal("family: tag36h11\n"),
            "tags.yaml: declares no marker's size (add default_size: 0.05 (in m))");
  EXPECT_NE(refusal("sizes: {3: 0.1}\ntags: [{id: 3, size: 0.1}]\n").find("marker 3 a second time"),
            std::string::npos);
}

TEST_F(TagsYaml, RefusesUnknownFamiliesAndKeysWithTheNearest) {
  const std::string family = refusal("family: tag36h12\ndefault_size: 0.05\n");
  EXPECT_TRUE(
      family.starts_with("tags.yaml:1: family 'tag36h12' is not known (did you mean 'tag36h11'?"))
      << family;
  EXPECT_EQ(
      refusal("defaultsize: 0.05\n"),
      "tags.yaml:1: defaultsize is a key nobody reads (did you mean 'default_size'? known: family, "
      "default_size, sizes, tags, boards, only_listed)");
  EXPECT_NE(refusal("boards: {1: {columns: 3, rows: 2, sqare: 1}}").find("'square'"),
            std::string::npos);
  EXPECT_NE(refusal("sizes:\n  a: 0.1\n").find("sizes.a does not stand under a marker's number"),
            std::string::npos);
  EXPECT_NE(refusal("sizes: 0.1\n").find("sizes is no mapping"), std::string::npos);
}

TEST_F(TagsYaml, RefusesWhatIsNoYaml) {
  const std::string message = refusal("family: tag36h11\nsizes: {1: 0.1\nx: y\n");
  EXPECT_TRUE(message.starts_with("tags.yaml:")) << message;
  EXPECT_NE(message.find("is not YAML"), std::string::npos) << message;
  EXPECT_EQ(refusal(""), "tags.yaml: is empty (write it, or remove the file)");
  EXPECT_NE(refusal("just words\n").find("does not hold keys with values"), std::string::npos);
  EXPECT_NE(
      refusal("sizes: {1: 0.1}\nsizes: {2: 0.1}\n").find("tags.yaml:2: sizes stands there twice"),
      std::string::npos);
  EXPECT_NE(refusal(std::string(2U << 20U, '#')).find("is this the right file?"),
            std::string::npos);
  EXPECT_NE(refusal("default_size: " + std::string(100000, '[')).find("is not YAML"),
            std::string::npos);
}

TEST_F(TagsYaml, OfTheSyntheticRecordings) {
  const auto file = shared_data("synthetic/ur6_none/tags.yaml");
  if (!file) GTEST_SKIP() << "shared recordings are not on this machine";
  const MarkerSet markers = read_marker_set(*file);
  EXPECT_EQ(markers.size_m(TagId{44}), 0.09);
  EXPECT_EQ(markers.default_size_m, 0.048);
}

}  // namespace
}  // namespace kinescope
