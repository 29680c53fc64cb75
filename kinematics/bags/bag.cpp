// SPDX-License-Identifier: Apache-2.0
#include "kinematics/bags/bag.h"

#include <algorithm>
#include <utility>

#include "kinematics/bags/bag_files.h"
#include "kinematics/core/error.h"

namespace kinescope::bags {
namespace fs = std::filesystem;

std::optional<Source> bag_source(const fs::path& path) {
  const auto is_one = [](const fs::path& bag) { return is_bag_file(bag) || is_bag_folder(bag); };
  const auto without_slash = [](const fs::path& bag) {
    return bag.has_filename() ? bag : bag.parent_path();
  };
  const std::string text = path.string();
  std::error_code error;
  // What is there by this name needs no topic.
  for (std::size_t colon = fs::exists(path, error) ? std::string::npos : text.find(':');
       colon != std::string::npos; colon = text.find(':', colon + 1)) {
    const fs::path bag = text.substr(0, colon);
    const bool names_topic = colon + 1 < text.size();
    if (names_topic && is_one(bag)) return Source{without_slash(bag), text.substr(colon + 1)};
  }
  if (is_one(path)) return Source{without_slash(path), {}};
  return std::nullopt;
}

bool is_bag(const fs::path& path) { return bag_source(path).has_value(); }

std::vector<fs::path> files_of(const fs::path& bag) {
  std::error_code error;
  if (fs::is_directory(bag, error)) return files_of_folder(bag);
  return {bag};
}

std::unique_ptr<Reader> open(const fs::path& bag) {
  std::error_code error;
  if (fs::is_directory(bag, error)) return open_folder(bag);
  return open_file(bag);
}

std::string plain_type(std::string_view type) {
  std::string out(type);
  const std::size_t msg = out.find("/msg/");
  if (msg != std::string::npos) out.erase(msg, 4);
  return out;
}

Encoding encoding_of(std::string_view name) {
  if (name == "cdr") return Encoding::kCdr;
  return name == "ros1" || name == "ros1msg" ? Encoding::kRos1 : Encoding::kOther;
}

void TopicTable::add(std::uint32_t number, Topic topic) {
  if (numbers_.contains(number)) return;
  const auto [known, is_new] =
      names_.try_emplace(std::tuple(topic.name, topic.type, topic.encoding_name), topics_.size());
  numbers_.emplace(number, known->second);
  if (is_new) topics_.push_back(std::move(topic));
}

std::optional<std::size_t> TopicTable::index_of(std::uint32_t number) const {
  const auto found = numbers_.find(number);
  if (found == numbers_.end()) return std::nullopt;
  return found->second;
}

std::string_view ByteReader::take(std::uint64_t size) {
  if (size > bytes_.size()) throw CutOff{};
  const std::string_view out = bytes_.substr(0, static_cast<std::size_t>(size));
  bytes_.remove_prefix(static_cast<std::size_t>(size));
  return out;
}

std::uint64_t ByteReader::number(std::size_t size) {
  const std::string_view bytes = take(size);
  std::uint64_t out = 0;
  for (std::size_t i = size; i-- > 0;) out = out << 8U | static_cast<std::uint8_t>(bytes[i]);
  return out;
}

InputFile::InputFile(const NamedFile& file) : name_(file.name) {
  const fs::path& path = file.path;
  std::error_code error;
  const fs::file_status status = fs::status(path, error);
  if (!fs::exists(status)) throw bad_input(name_, "no such file", "check the path");
  if (!fs::is_regular_file(status)) throw bad_input(name_, "is no file", "name a bag");
  size_ = fs::file_size(path, error);
  if (size_ == 0) throw bad_input(name_, "the bag is empty", "copy or record it again");
  stream_.open(path, std::ios::binary);
  if (!stream_) throw bad_input(name_, "may not be read", "check its permissions");
}

std::string InputFile::read(std::uint64_t size) {
  if (size > left()) throw CutOff{};
  std::string out(static_cast<std::size_t>(size), '\0');
  stream_.read(out.data(), static_cast<std::streamsize>(size));
  if (!stream_) throw CutOff{};
  position_ += size;
  return out;
}

void InputFile::skip(std::uint64_t size) {
  if (size > left()) throw CutOff{};
  position_ += size;
  stream_.seekg(static_cast<std::streamoff>(position_));
}

}  // namespace kinescope::bags
