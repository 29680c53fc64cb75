// SPDX-License-Identifier: Apache-2.0
//
// Containers and messages against bags that other people's writers made (data/README.md).
#include "kinematics/bags/bag.h"

#include <fstream>
#include <map>

#include <fmt/format.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "kinematics/bags/bag_contents.h"
#include "kinematics/bags/messages.h"
#include "kinematics/core/error.h"
#include "tests/truth/bag_writer.h"
#include "tests/truth/shared_data.h"
#include "tests/truth/temporary_path.h"

namespace kinescope::bags {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;

const fs::path kData = fs::path(KINESCOPE_SOURCE_DIR) / "tests/kinematics/bags/data";

json read_json(const std::string& name) {
  std::ifstream stream(kData / name);
  return json::parse(stream);
}

std::int64_t ns(const json& number) { return std::stoll(number.get<std::string>()); }

void expect_same(const JointState& read, const json& expected) {
  EXPECT_EQ(read.stamp_ns, ns(expected["stamp_ns"]));
  EXPECT_EQ(read.name, expected["name"].get<std::vector<std::string>>());
  EXPECT_EQ(read.position, expected["position"].get<std::vector<double>>());
  EXPECT_EQ(read.velocity, expected["velocity"].get<std::vector<double>>());
  EXPECT_EQ(read.effort, expected["effort"].get<std::vector<double>>());
}

void expect_same(const Image& read, const json& expected) {
  EXPECT_EQ(read.stamp_ns, ns(expected["stamp_ns"]));
  EXPECT_EQ(read.width, expected["width"].get<std::uint32_t>());
  EXPECT_EQ(read.height, expected["height"].get<std::uint32_t>());
  EXPECT_EQ(read.encoding, expected["encoding"].get<std::string>());
  EXPECT_EQ(read.step, expected["step"].get<std::uint32_t>());
  const auto pixels = expected["data"].get<std::vector<std::uint8_t>>();
  EXPECT_EQ(std::vector<std::uint8_t>(read.pixels.begin(), read.pixels.end()), pixels);
}

void expect_same(const CameraInfo& read, const json& expected) {
  EXPECT_EQ(read.width, expected["width"].get<std::uint32_t>());
  EXPECT_EQ(read.height, expected["height"].get<std::uint32_t>());
  EXPECT_EQ(read.distortion_model, expected["distortion_model"].get<std::string>());
  EXPECT_EQ(read.d, expected["d"].get<std::vector<double>>());
  EXPECT_EQ(json(read.k), expected["k"]);
  EXPECT_EQ(json(read.p), expected["p"]);
}

void expect_same(const TagDetections& read, const json& expected) {
  EXPECT_EQ(read.stamp_ns, ns(expected["stamp_ns"]));
  ASSERT_EQ(read.tags.size(), expected["detections"].size());
  for (std::size_t i = 0; i < read.tags.size(); ++i) {
    const json& tag = expected["detections"][i];
    EXPECT_EQ(read.tags[i].family, tag["family"].get<std::string>());
    EXPECT_EQ(read.tags[i].id, tag["id"].get<int>());
    EXPECT_EQ(read.tags[i].hamming, tag["hamming"].get<int>());
    EXPECT_EQ(read.tags[i].decision_margin, tag["decision_margin"].get<float>());
    for (std::size_t corner = 0; corner < 4; ++corner) {
      EXPECT_EQ(read.tags[i].corners[corner][0], tag["corners"][corner]["x"].get<double>());
      EXPECT_EQ(read.tags[i].corners[corner][1], tag["corners"][corner]["y"].get<double>());
    }
  }
}

void expect_message(const Topic& topic, const Message& message, const json& expected) {
  EXPECT_EQ(message.received_ns, ns(expected["receive_ns"]));
  if (topic.type == kJointStateType) {
    expect_same(read_joint_state(message.data, topic.encoding), expected);
  } else if (topic.type == kImageType) {
    expect_same(read_image(message.data, topic.encoding), expected);
  } else if (topic.type == kCameraInfoType) {
    expect_same(read_camera_info(message.data, topic.encoding), expected);
  } else if (topic.type == kDetectionsType) {
    expect_same(read_tag_detections(message.data, topic.encoding), expected);
  } else if (topic.type == kCompressedImageType) {
    const PackedImage read = read_compressed_image(message.data, topic.encoding);
    EXPECT_EQ(read.stamp_ns, ns(expected["stamp_ns"]));
    EXPECT_EQ(read.format, expected["format"].get<std::string>());
    EXPECT_EQ(read.data.size(), expected["data_size"].get<std::size_t>());
  }
}

class WholeBag : public testing::TestWithParam<const char*> {};

TEST_P(WholeBag, HoldsEveryMessage) {
  const json expected = read_json("expected.json")["topics"];
  const auto reader = open(kData / GetParam());
  std::map<std::string, std::size_t> met;
  while (const auto message = reader->next()) {
    const Topic& topic = reader->topics()[message->topic];
    SCOPED_TRACE(fmt::format("{} {}", topic.name, met[topic.name]));
    ASSERT_TRUE(expected.contains(topic.name));
    const json& messages = expected[topic.name]["messages"];
    ASSERT_LT(met[topic.name], messages.size());
    expect_message(topic, *message, messages[met[topic.name]++]);
  }
  EXPECT_TRUE(reader->warnings().empty());
  for (const Topic& topic : reader->topics())
    EXPECT_EQ(met[topic.name], expected[topic.name]["messages"].size()) << topic.name;
  EXPECT_EQ(met["/joint_states"], 40U);
}

INSTANTIATE_TEST_SUITE_P(Writers, WholeBag,
                         testing::Values("joints_none.mcap", "joints_lz4.mcap", "joints_zstd.mcap",
                                         "joints_unchunked.mcap", "joints_xcdr_be.mcap",
                                         "joints_mcap_folder", "joints_ros1_none.bag",
                                         "joints_ros1_lz4.bag", "joints_ros1_bz2.bag",
                                         "joints_sqlite3", "joints_sqlite3_zstd_file",
                                         "joints_sqlite3_zstd_message"));

TEST(Bag, WithoutASummaryIsRead) {
  const auto reader = open(kData / "joints_no_index.mcap");
  int messages = 0;
  while (reader->next()) ++messages;
  EXPECT_EQ(messages, 66);
}

struct Damaged {
  const char* file;
  std::size_t joint_states;
  const char* words;
};

class DamagedBag : public testing::TestWithParam<Damaged> {};

TEST_P(DamagedBag, IsReadAsFarAsItCanBe) {
  const Contents& contents = look_into(kData / GetParam().file);
  std::size_t found = 0;
  for (const JointSeries& series : contents.joints)
    if (series.topic == "/joint_states") found += series.times_s.size();
  EXPECT_EQ(found, GetParam().joint_states);
  ASSERT_EQ(contents.warnings.size(), 1U);
  EXPECT_NE(contents.warnings.front().find(GetParam().words), std::string::npos)
      << contents.warnings.front();
}

// What is readable: damaged.json; of cut.bag also what stands in the chunk before the cut.
INSTANTIATE_TEST_SUITE_P(Ways, DamagedBag,
                         testing::Values(Damaged{"cut_in_chunk.mcap", 16, "ends early"},
                                         Damaged{"bad_crc.mcap", 6, "checksum"},
                                         Damaged{"huge_length.mcap", 3, "ends early"},
                                         Damaged{"zstd_bomb.mcap", 5, "damaged"},
                                         Damaged{"deep_names.mcap", 2,
                                                 "1 of 3 messages of /joint_states"},
                                         Damaged{"cut.bag", 11, "ends early"}));

TEST(Bag, EveryCutIsRead) {
  const fs::path whole = kData / "joints_zstd.mcap";
  std::ifstream stream(whole, std::ios::binary);
  const std::string bytes((std::istreambuf_iterator<char>(stream)), {});
  const fs::path cut = truth::temporary_path("cut.mcap");
  constexpr std::size_t kMagic = 8;
  std::size_t before = 0;
  for (std::size_t size = kMagic + 1; size < bytes.size(); size += 97) {
    std::ofstream(cut, std::ios::binary) << bytes.substr(0, size);
    const auto reader = open(cut);
    std::size_t messages = 0;
    while (reader->next()) ++messages;
    EXPECT_GE(messages, before) << size;
    before = messages;
  }
  EXPECT_EQ(before, 66U);
}

TEST(Bag, RefusesWhatIsNone) {
  for (const char* name : {"none.mcap", "none.bag", "none.db3"}) {
    const fs::path path = truth::temporary_path(name);
    EXPECT_THROW(static_cast<void>(open(path)), Error) << "missing";
    std::ofstream(path) << "";
    EXPECT_THROW(static_cast<void>(open(path)), Error) << "empty";
    std::ofstream(path) << "t,q1\n0,0\n";
    EXPECT_THROW(static_cast<void>(open(path)), Error) << "a table";
  }
}

TEST(Bag, DamageThatHidesTopicsIsSaid) {
  std::ifstream stream(kData / "joints_zstd.mcap", std::ios::binary);
  std::string bytes((std::istreambuf_iterator<char>(stream)), {});
  const std::size_t frame = bytes.find("\x28\xB5\x2F\xFD");  // of the first chunk
  ASSERT_NE(frame, std::string::npos);
  bytes[frame + 9] = static_cast<char>(bytes[frame + 9] ^ 0x40);
  const fs::path path = truth::temporary_path("first_chunk.mcap");
  std::ofstream(path, std::ios::binary) << bytes;
  const Contents contents = read_contents(path);
  ASSERT_EQ(contents.warnings.size(), 2U);
  EXPECT_NE(contents.warnings[1].find("topic stood in a damaged chunk"), std::string::npos);
}

TEST(Bag, NothingIsLeftBesideADatabase) {
  const fs::path folder = truth::temporary_path("a b#1?%41");
  fs::create_directories(folder);
  for (const fs::directory_entry& entry : fs::directory_iterator(kData / "joints_sqlite3"))
    fs::copy(entry.path(), folder / entry.path().filename());
  const auto count = [&] {
    return std::distance(fs::directory_iterator(folder), fs::directory_iterator());
  };
  const auto before = count();
  EXPECT_EQ(read_contents(folder).joints.front().times_s.size(), 40U);
  EXPECT_EQ(count(), before);
}

// The first database of the folder, `kept` of its pages, by itself.
fs::path cut_database(const std::string& name, std::size_t kept, bool of_changes = false) {
  constexpr std::size_t kPage = 1024;
  std::ifstream stream(kData / "joints_sqlite3" / "joints_sqlite3_0.db3", std::ios::binary);
  std::string bytes{std::istreambuf_iterator<char>(stream), {}};
  if (of_changes) bytes[18] = bytes[19] = 2;
  const fs::path folder = truth::temporary_path(name);
  fs::create_directories(folder);
  std::ofstream(folder / "r.db3", std::ios::binary)
      << bytes.substr(0, std::min(bytes.size(), kept * kPage));
  return folder / "r.db3";
}

TEST(Bag, ADatabaseThatIsCutOffIsReadUpToThere) {
  const Contents whole = read_contents(cut_database("whole_db", 1000));
  EXPECT_TRUE(whole.warnings.empty());
  const Contents cut = read_contents(cut_database("cut_db", 8));
  ASSERT_FALSE(cut.joints.empty());
  EXPECT_FALSE(cut.joints.front().times_s.empty());
  EXPECT_LT(cut.joints.front().times_s.size(), whole.joints.front().times_s.size());
  ASSERT_FALSE(cut.warnings.empty());
  EXPECT_NE(cut.warnings.front().find("the file is cut off"), std::string::npos);
}

TEST(Bag, ChangesThatWereNotCopiedAreMissed) {
  const fs::path file = cut_database("changes_db", 1000, true);
  const Contents contents = read_contents(file);
  ASSERT_EQ(contents.warnings.size(), 1U);
  EXPECT_NE(contents.warnings[0].find("r.db3-wal, which is not there"), std::string::npos)
      << contents.warnings[0];
  std::ofstream(file.parent_path() / "metadata.yaml") << "ended: well\n";
  EXPECT_TRUE(read_contents(file).warnings.empty());
}

TEST(Bag, SourceNamesATopic) {
  const fs::path file = truth::temporary_path("named.mcap");
  truth::BagWriter(file).finish();
  const auto source = bag_source(file.string() + ":/arm/joint_states");
  ASSERT_TRUE(source);
  EXPECT_EQ(source->bag, file);
  EXPECT_EQ(source->topic, "/arm/joint_states");
  EXPECT_EQ(bag_source(file.string() + ":joint_states")->topic, "joint_states");
  EXPECT_EQ(bag_source(file)->topic, "");
  EXPECT_FALSE(bag_source("joints.csv"));
  EXPECT_FALSE(bag_source("video.mp4:/x"));
  EXPECT_TRUE(is_bag(kData / "joints_sqlite3"));
  EXPECT_FALSE(is_bag(kData));
}

TEST(Bag, OfRos2AndRos1InTheWildIsRead) {
  const auto folder = shared_data("bags");
  if (!folder) GTEST_SKIP() << "shared/data is not on this machine";
  int bags = 0;
  for (const fs::directory_entry& entry : fs::recursive_directory_iterator(*folder)) {
    if (!is_bag(entry.path())) continue;
    SCOPED_TRACE(entry.path().string());
    const Contents& contents = look_into(entry.path());
    EXPECT_TRUE(contents.joints.empty());
    EXPECT_TRUE(contents.images.empty());
    EXPECT_TRUE(contents.warnings.empty());
    EXPECT_FALSE(contents.topics.empty());
    ++bags;
  }
  EXPECT_GE(bags, 40);
}

}  // namespace
}  // namespace kinescope::bags
