// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <array>
#include <cstdlib>
#include <utility>

#include <fmt/format.h>
#include <unistd.h>
#include <yaml-cpp/yaml.h>

#include "kinematics/bags/bag_files.h"
#include "kinematics/bags/unpack.h"
#include "kinematics/core/error.h"
#include "kinematics/core/file.h"

namespace kinescope::bags {
namespace fs = std::filesystem;
namespace {

constexpr std::string_view kMetadata = "metadata.yaml";
constexpr std::string_view kPacked = ".zstd";

/// The ending without that of a file that is packed as a whole.
std::string format_ending(const fs::path& path) {
  return path.extension() == kPacked ? path.stem().extension().string() : path.extension().string();
}

struct Folder {
  std::vector<fs::path> files;
  RowPacking packing = RowPacking::kNone;
};

std::vector<fs::path> bags_in(const fs::path& folder) {
  std::vector<fs::path> files;
  std::error_code error;
  for (const fs::directory_entry& entry : fs::directory_iterator(folder, error)) {
    if (is_bag_file(entry.path())) files.push_back(entry.path());
  }
  std::ranges::sort(files);
  return files;
}

// Files that the metadata names and that are not there may have been unpacked, or packed, since.
fs::path present(const fs::path& folder, const fs::path& named) {
  const fs::path whole = folder / named.filename();
  std::error_code error;
  if (fs::exists(whole, error)) return whole;
  fs::path other = whole;
  if (whole.extension() == kPacked) {
    other.replace_extension();
  } else {
    other += kPacked;
  }
  if (fs::exists(other, error)) return other;
  throw bad_input((folder / kMetadata).string(),
                  fmt::format("names {}, which is not there", named.filename().string()),
                  "copy the whole folder of the bag");
}

Folder read_folder(const fs::path& folder) {
  Folder out;
  const fs::path file = folder / kMetadata;
  std::error_code error;
  if (!fs::exists(file, error)) {
    out.files = bags_in(folder);
    if (out.files.empty()) {
      throw bad_input(folder.string(), "holds no bag", "name a .mcap, .db3 or .bag file");
    }
    return out;
  }
  constexpr std::uintmax_t kLargest = 1U << 26U;
  try {
    const YAML::Node root = YAML::Load(read_text_file(file, kLargest));
    const YAML::Node info = root["rosbag2_bagfile_information"];
    for (const YAML::Node& name : info["relative_file_paths"])
      out.files.push_back(present(folder, name.as<std::string>()));
    const auto mode = info["compression_mode"].as<std::string>("");
    const auto format = info["compression_format"].as<std::string>("");
    if (mode == "MESSAGE" || mode == "message") {
      if (format != "zstd") {
        throw bad_input(file.string(), fmt::format("messages packed with '{}'", format),
                        "zstd is read: convert the bag (ros2 bag convert)");
      }
      out.packing = RowPacking::kZstd;
    }
  } catch (const YAML::Exception& fault) {
    throw bad_input(fmt::format("{}:{}", file.string(), fault.mark.line + 1), fault.msg,
                    "copy it again, or make it anew (ros2 bag reindex)");
  }
  if (out.files.empty()) {
    throw bad_input(file.string(), "names no file of the bag",
                    "copy it again, or make it anew (ros2 bag reindex)");
  }
  return out;
}

/// One file after the other, their topics as one list.
class FolderReader final : public Reader {
 public:
  explicit FolderReader(Folder folder) : folder_(std::move(folder)) { open_next(); }

  const std::vector<Topic>& topics() const override { return topics_; }
  const std::vector<std::string>& warnings() const override { return warnings_; }

  std::optional<Message> next() override {
    while (reader_) {
      if (auto message = reader_->next()) {
        message->topic = index_of(message->topic);
        return message;
      }
      take_topics();
      const std::vector<std::string>& said = reader_->warnings();
      warnings_.insert(warnings_.end(), said.begin(), said.end());
      open_next();
    }
    return std::nullopt;
  }

 private:
  void open_next() {
    reader_.reset();
    indices_.clear();
    if (opened_ == folder_.files.size()) return;
    reader_ = open_file(folder_.files[opened_++], folder_.packing);
    take_topics();
  }

  void take_topics() {
    for (std::size_t i = indices_.size(); i < reader_->topics().size(); ++i) {
      const Topic& topic = reader_->topics()[i];
      const auto same = std::ranges::find_if(topics_, [&](const Topic& known) {
        return known.name == topic.name && known.type == topic.type;
      });
      indices_.push_back(static_cast<std::size_t>(same - topics_.begin()));
      if (same == topics_.end()) topics_.push_back(topic);
    }
  }

  std::size_t index_of(std::size_t topic) {
    take_topics();
    return indices_[topic];
  }

  Folder folder_;
  std::size_t opened_ = 0;
  std::unique_ptr<Reader> reader_;
  std::vector<Topic> topics_;
  std::vector<std::size_t> indices_;  // of the open file's topics
  std::vector<std::string> warnings_;
};

/// A file that is gone when it is closed.
class TemporaryFile {
 public:
  explicit TemporaryFile(const std::string& ending) {
    std::error_code error;
    const fs::path folder = fs::temp_directory_path(error);
    name_ = (folder / "kinescope-XXXXXX").string() + ending;
    const int file = error ? -1 : mkstemps(name_.data(), static_cast<int>(ending.size()));
    if (file < 0) {
      throw bad_input(name_, "cannot be made", "name a folder for temporary files in TMPDIR");
    }
    ::close(file);
  }
  ~TemporaryFile() {
    std::error_code error;
    fs::remove(name_, error);
  }
  TemporaryFile(const TemporaryFile&) = delete;
  TemporaryFile& operator=(const TemporaryFile&) = delete;
  TemporaryFile(TemporaryFile&&) = delete;
  TemporaryFile& operator=(TemporaryFile&&) = delete;

  [[nodiscard]] const std::string& name() const { return name_; }

 private:
  std::string name_;
};

}  // namespace

bool is_bag_file(const fs::path& path) {
  constexpr std::array kEndings = {".mcap", ".db3", ".bag"};
  std::error_code error;
  const std::string ending = format_ending(path);
  return std::ranges::find(kEndings, ending) != kEndings.end() && !fs::is_directory(path, error);
}

bool is_bag_folder(const fs::path& path) {
  std::error_code error;
  if (!fs::is_directory(path, error)) return false;
  const fs::path file = path / kMetadata;
  if (!fs::is_regular_file(file, error)) return false;
  std::ifstream stream(file);
  std::string line;
  while (std::getline(stream, line)) {
    if (line.ends_with('\r')) line.pop_back();
    if (line.starts_with("rosbag2_bagfile_information:")) return true;
    if (!line.empty() && line.front() != '#' && line.front() != '%' && line != "---") return false;
  }
  return false;
}

std::vector<fs::path> files_of_folder(const fs::path& folder) { return read_folder(folder).files; }

std::unique_ptr<Reader> open_folder(const fs::path& folder) {
  return std::make_unique<FolderReader>(read_folder(folder));
}

std::unique_ptr<Reader> open_file(const fs::path& file, RowPacking packing) {
  const std::string ending = format_ending(file);
  const auto open_plain = [&](const fs::path& plain) {
    const NamedFile named{plain, file.string()};
    if (ending == ".mcap") return open_mcap(named);
    if (ending == ".db3") return open_sqlite(named, packing);
    return open_ros1(named);
  };
  if (file.extension() != kPacked) return open_plain(file);
  static_cast<void>(InputFile({file, file.string()}));  // missing, empty, may not be read
  const TemporaryFile unpacked(ending);
  unpack_zstd_file(file, unpacked.name());
  return open_plain(unpacked.name());  // an open file stays when its name goes
}

}  // namespace kinescope::bags
