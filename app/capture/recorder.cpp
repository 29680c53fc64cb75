// SPDX-License-Identifier: Apache-2.0
#include "app/capture/recorder.h"

#include <algorithm>
#include <array>
#include <cstddef>
#include <string_view>
#include <system_error>
#include <utility>

#include <fcntl.h>
#include <fmt/format.h>
#include <unistd.h>

#include "app/io/same_place.h"
#include "kinematics/core/error.h"
#include "kinematics/core/file.h"

namespace kinescope {
namespace {

namespace fs = std::filesystem;

constexpr const char* kImages = "images";
constexpr const char* kTimes = "times.csv";
constexpr const char* kJoints = "joints.csv";

Error cannot_write(const fs::path& path) {
  return bad_request(path.string(), "cannot be written",
                     "is the disk full? What was recorded before is kept");
}

/// All of the bytes, or false.
bool write_all(int file, std::string_view bytes) {
  while (!bytes.empty()) {
    const ssize_t n = ::write(file, bytes.data(), bytes.size());
    if (n <= 0) return false;
    bytes.remove_prefix(static_cast<std::size_t>(n));
  }
  return true;
}

void write_image(const fs::path& path, std::span<const std::uint8_t> jpeg) {
  const int file = ::open(path.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0666);
  const bool opened = file >= 0;
  const bool written =
      opened && write_all(file, {reinterpret_cast<const char*>(jpeg.data()), jpeg.size()});
  const bool closed = opened && ::close(file) == 0;
  if (written && closed) return;
  std::error_code ignored;
  if (opened) fs::remove(path, ignored);
  throw cannot_write(path);
}

std::string tags_yaml(const MarkerSet& markers) {
  return fmt::format("family: {}\ndefault_size: {:.6g}  # m, edge of the black square\n",
                     markers.family, markers.default_size_m);
}

/// Images that `capture` wrote, by their names: whoever put others there keeps them.
void remove_recording(const fs::path& folder) {
  std::error_code error;
  fs::remove(folder / kImages / kTimes, error);
  std::vector<fs::path> images;
  for (const auto& entry : fs::directory_iterator(folder / kImages, error)) {
    const std::string stem = entry.path().stem().string();
    const bool number = stem.find_first_not_of("0123456789") == std::string::npos;
    if (number && entry.path().extension() == ".jpg") images.push_back(entry.path());
  }
  for (const fs::path& image : images) fs::remove(image, error);
  fs::remove(folder / kJoints, error);
}

}  // namespace

LineFile::LineFile(const fs::path& path)
    : path_(path),
      file_(::open(path.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_APPEND | O_CLOEXEC, 0666)) {
  if (file_ < 0) throw cannot_write(path_);
}

LineFile::~LineFile() {
  if (file_ >= 0) ::close(file_);
}

void LineFile::add(const std::string& lines) {
  if (write_all(file_, lines)) {
    size_ += static_cast<std::int64_t>(lines.size());
    return;
  }
  // Half a number is another number.
  static_cast<void>(::ftruncate(file_, size_));
  throw cannot_write(path_);
}

void require_room_for_recording(const fs::path& folder, bool force) {
  std::error_code error;
  for (const auto& entry : fs::directory_iterator(folder, error)) {
    const std::string name = entry.path().filename().string();
    const std::string stem = entry.path().stem().string();
    const bool own = name == kImages || name == kJoints;
    constexpr std::array<std::string_view, 5> kOthers = {"video", "corners", "poses", "points",
                                                         "flange"};
    const bool other = std::ranges::find(kOthers, stem) != kOthers.end();
    if (other) {
      throw bad_request(entry.path().string(), "the folder holds another recording",
                        "name a new folder with --output");
    }
    if (own && !force) {
      throw bad_request(entry.path().string(), "the folder holds a recording already",
                        "name a new folder with --output, or replace it with --force");
    }
  }
  require_writable_folder(folder);
}

Recorder::Recorder(fs::path folder, const RecordingHead& head) : folder_(std::move(folder)) {
  remove_recording(folder_);
  const auto copy = [&](const fs::path& from, const char* name) {
    if (!same_place(from, folder_ / name))
      write_file_atomically(folder_ / name, read_text_file(from));
  };
  if (head.tags) {
    copy(*head.tags, "tags.yaml");
  } else {
    set_family(head.markers);
  }
  if (head.camera) copy(*head.camera, "camera.yaml");
  require_writable_folder(folder_ / kImages);
  times_.emplace(folder_ / kImages / kTimes);
  times_->add("image,t\n");
}

void Recorder::set_family(const MarkerSet& markers) const {
  write_file_atomically(folder_ / "tags.yaml", tags_yaml(markers));
}

void Recorder::add_frame(double time_s, std::span<const std::uint8_t> jpeg) {
  const std::string name = fmt::format("{:06}.jpg", frames_);
  write_image(folder_ / kImages / name, jpeg);
  value_of(times_).add(fmt::format("{},{:.6f}\n", name, time_s));
  ++frames_;
  last_s_ = time_s;
}

void Recorder::add_joints(const std::vector<std::string>& channels, std::span<const JointRow> rows,
                          double begin_s) {
  std::string lines;
  if (!joints_) {
    joints_.emplace(folder_ / kJoints);
    lines = "t";
    for (const std::string& channel : channels) lines += "," + channel;
    lines += "\n";
  }
  for (const JointRow& row : rows) {
    lines += fmt::format("{:.6f}", row.stamp_s - begin_s);
    for (const double value : row.values) lines += fmt::format(",{:.12g}", value);
    lines += "\n";
  }
  joints_->add(lines);
}

}  // namespace kinescope
