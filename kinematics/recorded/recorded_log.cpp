// SPDX-License-Identifier: Apache-2.0
#include "kinematics/recorded/recorded_log.h"

#include <algorithm>
#include <utility>

#include "kinematics/bags/bag_log.h"
#include "kinematics/datasets/dataset_log.h"
#include "kinematics/log/joint_log_table.h"
#include "kinematics/log/tool_table.h"
#include "kinematics/mat/mat_log.h"

namespace kinescope::recorded {

LogTable read_log_table(const std::filesystem::path& path, const std::vector<std::string>& keep) {
  if (const auto bag = bags::bag_source(path)) {
    bags::LogTable read = bags::joint_table(*bag);
    return {std::move(read.table), std::move(read.warnings), {}};
  }
  if (const auto dataset = datasets::dataset_source(path)) {
    datasets::JointSignals signals = datasets::read_signals(*dataset);
    return {datasets::joint_table(signals), std::move(signals.warnings),
            datasets::joined_at_s(signals)};
  }
  if (mat::is_mat(path)) {
    mat::LogTable read = mat::joint_table(path);
    return {std::move(read.table), std::move(read.warnings), {}};
  }
  CsvTable table = read_csv(path, RaggedRows::kSetAside);
  std::vector<std::string> said = make_time_plain(table);
  return {with_log_names(std::move(table), keep), std::move(said), {}};
}

JointLog read_joint_log(const std::filesystem::path& path,
                        const std::vector<std::string>& torque_channels) {
  LogTable read = recorded::read_log_table(path, torque_channels);
  JointLog log = joint_log_of(std::move(read.table), torque_channels).log;
  log.warnings.insert(log.warnings.begin(), read.warnings.begin(), read.warnings.end());
  log.joined_at_s = std::move(read.joined_at_s);
  return log;
}

ChannelTable read_channel_table(const std::filesystem::path& path) {
  if (const auto bag = bags::bag_source(path)) return bags::channel_table(*bag);
  if (const auto dataset = datasets::dataset_source(path))
    return datasets::channel_table(datasets::read_signals(*dataset));
  if (mat::is_mat(path)) return mat::channel_table(path);
  return kinescope::read_channel_table(path);
}

std::vector<ChannelTable> read_channel_tables(const std::vector<std::filesystem::path>& paths) {
  std::vector<ChannelTable> out;
  for (const std::filesystem::path& path : paths) out.push_back(recorded::read_channel_table(path));
  return out;
}

TorqueColumns torque_columns(const std::filesystem::path& log, const std::string& channel,
                             const std::string& torque) {
  if (bags::is_bag(log)) {
    const auto [position, effort] = bags::torque_columns(channel, torque);
    return {position, effort};
  }
  if (const auto dataset = datasets::dataset_source(log)) {
    const auto [position, effort] = datasets::torque_names(*dataset, channel, torque);
    return {position, effort};
  }
  if (mat::is_mat(log)) return {channel, torque};
  // As another tool named them.
  const CsvTable table = read_csv(log, RaggedRows::kSetAside);
  const std::vector<std::string> names = log_names(table);
  const auto in_file = [&](const std::string& name) {
    const auto found = std::ranges::find(names, name);
    return found == names.end() ? name
                                : table.header[static_cast<std::size_t>(found - names.begin())];
  };
  return {in_file(channel), in_file(torque)};
}

}  // namespace kinescope::recorded
