// SPDX-License-Identifier: Apache-2.0
#include "kinematics/datasets/dataset_log.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <set>
#include <utility>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "kinematics/core/error.h"
#include "kinematics/parquet/parquet_file.h"

namespace kinescope::datasets {
namespace {

using Signal = JointSignals::Signal;

constexpr const char* kState = "observation.state";
constexpr const char* kAction = "action";
const std::string kTorquePrefix = "tau_";
const std::string kCommandEnding = "_command";

/// A suffix of an element's name, or a feature's name, and what it says.
struct Word {
  const char* word;
  Quantity quantity;
};
constexpr std::array kSuffixes = {
    Word{".pos", Quantity::kPosition},  Word{".position", Quantity::kPosition},
    Word{".vel", Quantity::kVelocity},  Word{".velocity", Quantity::kVelocity},
    Word{".torque", Quantity::kEffort}, Word{".effort", Quantity::kEffort},
    Word{".tau", Quantity::kEffort},    Word{".current", Quantity::kCurrent},
};
constexpr std::array kFeatures = {
    Word{kState, Quantity::kPosition},
    Word{"observation.velocity", Quantity::kVelocity},
    Word{"observation.effort", Quantity::kEffort},
    Word{"observation.torque", Quantity::kEffort},
    Word{"observation.current", Quantity::kCurrent},
    Word{kAction, Quantity::kCommand},
};

/// An element of a feature's rows that is read.
struct Element {
  std::size_t feature = 0;  ///< in a list of features
  std::size_t place = 0;    ///< in its row
  std::string joint;
  Quantity quantity = Quantity::kPosition;
};

/// The joint and quantity of an element: its suffix, where it has one, says more than its feature.
Element element_of(const std::string& name, Quantity of_feature) {
  for (const Word& suffix : kSuffixes) {
    if (!name.ends_with(suffix.word) || name.size() == std::string_view(suffix.word).size())
      continue;
    const std::string joint = name.substr(0, name.size() - std::string_view(suffix.word).size());
    const bool is_command = of_feature == Quantity::kCommand;
    // The command of a speed or a torque is none of a position.
    if (is_command && suffix.quantity != Quantity::kPosition) return {0, 0, {}, of_feature};
    return {0, 0, joint,
            is_command || of_feature != Quantity::kPosition ? of_feature : suffix.quantity};
  }
  return {0, 0, name, of_feature};
}

/// The names of a feature's elements; without any they are counted.
std::vector<std::string> names_of(const Feature& feature, const Dataset& dataset) {
  if (!feature.names.empty()) return feature.names;
  const Feature* state = dataset.feature(kState);
  const bool as_state = state != nullptr && state->shape == feature.shape;
  if (as_state && !state->names.empty()) return state->names;
  std::vector<std::string> out;
  const std::size_t count = feature.shape.size() == 1 ? feature.shape.front() : 0;
  for (std::size_t i = 1; i <= count; ++i) out.push_back(fmt::format("joint{}", i));
  return out;
}

/// What is read of a dataset's rows.
struct Plan {
  std::vector<const Feature*> features;
  std::vector<Element> elements;
  std::vector<std::string> warnings;
};

/// A name that was there before is counted: "gripper", "gripper_2".
void make_unique(std::vector<Element>& elements) {
  std::set<std::pair<std::string, Quantity>> taken;
  for (Element& element : elements) {
    const std::string name = element.joint;
    for (int count = 2; !taken.emplace(element.joint, element.quantity).second; ++count)
      element.joint = fmt::format("{}_{}", name, count);
  }
}

/// Commands of what is no joint (a hand's pose, a base's speed) are none.
void keep_commands_of_joints(Plan& plan, const Dataset& dataset) {
  std::set<std::string> joints;
  for (const Element& element : plan.elements)
    if (element.quantity == Quantity::kPosition) joints.insert(element.joint);
  const std::size_t before = plan.elements.size();
  std::erase_if(plan.elements, [&](const Element& element) {
    return element.joint.empty() ||
           (element.quantity == Quantity::kCommand && !joints.contains(element.joint));
  });
  if (plan.elements.size() == before) return;
  plan.warnings.push_back(
      fmt::format("{}: {} elements of action are no position of a joint of observation.state, and "
                  "are not used",
                  dataset.folder.string(), before - plan.elements.size()));
}

Plan plan_of(const Dataset& dataset) {
  Plan out;
  for (const Word& word : kFeatures) {
    const Feature* feature = dataset.feature(word.word);
    if (feature == nullptr) continue;
    const std::vector<std::string> names = names_of(*feature, dataset);
    if (names.empty()) continue;  // rows of rows
    std::size_t place = 0;
    for (const std::string& name : names) {
      Element element = element_of(name, word.quantity);
      element.feature = out.features.size();
      element.place = place++;
      out.elements.push_back(std::move(element));
    }
    out.features.push_back(feature);
  }
  const bool has_state = dataset.feature(kState) != nullptr;
  if (!has_state || out.elements.empty()) {
    std::vector<std::string> names;
    for (const Feature& feature : dataset.features) names.push_back(feature.name);
    throw bad_input(dataset.folder.string(),
                    has_state
                        ? "observation.state has no elements"
                        : fmt::format("has no observation.state, only {}", fmt::join(names, ", ")),
                    "record the joints' positions as LeRobot does");
  }
  make_unique(out.elements);
  keep_commands_of_joints(out, dataset);
  return out;
}

/// The columns of one file of rows that a plan needs.
struct RowFile {
  std::filesystem::path path;
  std::optional<parquet::Numbers> episode, stamp, frame;
  std::vector<parquet::Numbers> features;
};

RowFile read_rows(const std::filesystem::path& path, const Plan& plan) {
  const parquet::File file(path);
  const auto find = [&](const char* name) -> std::optional<parquet::Numbers> {
    if (!file.has(name)) return std::nullopt;
    return file.numbers(name);
  };
  RowFile out{path, find("episode_index"), find("timestamp"), find("frame_index"), {}};
  for (const Feature* feature : plan.features) out.features.push_back(file.numbers(feature->name));
  return out;
}

double first_of(const parquet::Numbers& column, std::size_t row) {
  return column.size_of(row) > 0 ? column.values[column.begin_of(row)] : std::nan("");
}

/// LeRobot's stamps are the frame's number by the rate, rounded to 32 bits: of an hour 0.1 ms.
double time_of_row(const RowFile& file, std::size_t row, std::size_t in_episode, double rate_hz) {
  const double number = file.frame ? first_of(*file.frame, row) : static_cast<double>(in_episode);
  const double even_s = number / rate_hz;
  if (!file.stamp) return even_s;
  const double stamp_s = first_of(*file.stamp, row);
  constexpr double kRounding = 1e-6;
  return std::abs(stamp_s - even_s) <= kRounding * std::max(1.0, std::abs(even_s)) ? even_s
                                                                                   : stamp_s;
}

/// Joins the rows of episodes.
class SignalReader {
 public:
  SignalReader(const Dataset& dataset, const Plan& plan) : dataset_(dataset), plan_(plan) {
    for (const Element& element : plan.elements)
      out_.signals.push_back({element.joint, element.quantity, {}});
  }

  void add(const Episode& episode, double start_s) {
    if (!file_ || file_->path != episode.rows) file_ = read_rows(episode.rows, plan_);
    std::size_t in_episode = 0;
    const std::size_t rows = file_->features.front().rows();
    for (std::size_t row = 0; row < rows; ++row) {
      if (file_->episode && first_of(*file_->episode, row) != static_cast<double>(episode.index)) {
        continue;
      }
      add_row(row, episode, start_s + time_of_row(*file_, row, in_episode, dataset_.frame_rate_hz));
      ++in_episode;
    }
    if (in_episode == episode.frames) return;
    throw bad_input(episode.rows.string(),
                    fmt::format("has {} rows of episode {}, which is listed with {}", in_episode,
                                episode.index, episode.frames),
                    "copy the dataset again, or name other episodes");
  }

  JointSignals finish() { return std::move(out_); }

 private:
  void add_row(std::size_t row, const Episode& episode, double time_s) {
    if (!std::isfinite(time_s) || (!out_.times_s.empty() && time_s <= out_.times_s.back())) {
      throw bad_input(fmt::format("{}: row {}", file_->path.string(), row + 1),
                      "its timestamp is none, or not behind that of the row before",
                      "name other episodes, or copy the dataset again");
    }
    for (std::size_t feature = 0; feature < plan_.features.size(); ++feature)
      check_length(feature, row);
    for (std::size_t i = 0; i < plan_.elements.size(); ++i) {
      const Element& element = plan_.elements[i];
      const parquet::Numbers& values = file_->features[element.feature];
      out_.signals[i].values.push_back(values.values[values.begin_of(row) + element.place]);
    }
    out_.times_s.push_back(time_s);
    out_.episodes.push_back(episode.index);
  }

  void check_length(std::size_t feature, std::size_t row) const {
    const Feature& declared = *plan_.features[feature];
    const std::size_t size = file_->features[feature].size_of(row);
    const std::size_t wanted = declared.shape.size() == 1 ? declared.shape.front() : 0;
    if (size == wanted) return;
    throw bad_input(
        fmt::format("{}: row {}", file_->path.string(), row + 1),
        fmt::format("{} has {} elements, and info.json declares {}", declared.name, size, wanted),
        "copy the dataset again");
  }

  const Dataset& dataset_;
  const Plan& plan_;
  std::optional<RowFile> file_;
  JointSignals out_;
};

std::string plural(std::size_t count, const char* word) {
  return fmt::format("{} {}{}", count, word, count == 1 ? "" : "s");
}

/// Torques of joints: efforts where there are any, else currents.
Quantity torque_quantity(const JointSignals& signals) {
  const bool efforts = std::ranges::any_of(
      signals.signals, [](const Signal& s) { return s.quantity == Quantity::kEffort; });
  return efforts ? Quantity::kEffort : Quantity::kCurrent;
}

const char* channel_ending(Quantity quantity) {
  switch (quantity) {
    case Quantity::kPosition:
      return "_position";
    case Quantity::kVelocity:
      return "_velocity";
    case Quantity::kEffort:
      return "_effort";
    case Quantity::kCurrent:
      return "_current";
    case Quantity::kCommand:
      return "_position_command";
  }
  return "";
}

}  // namespace

JointSignals read_signals(const Source& source) {
  const Dataset& dataset = look_into(source.folder);
  const Plan plan = plan_of(dataset);
  const Joined joined = choose_episodes(dataset, source);
  SignalReader reader(dataset, plan);
  for (std::size_t i = 0; i < joined.episodes.size(); ++i)
    reader.add(*joined.episodes[i], joined.starts_s[i]);
  JointSignals out = reader.finish();
  out.source = Source{source.folder, {}, source.episodes}.path().string();
  out.warnings = dataset.warnings;
  out.warnings.insert(out.warnings.end(), plan.warnings.begin(), plan.warnings.end());
  if (joined.episodes.size() > 1) {
    out.warnings.push_back(fmt::format(
        "{}: {} with {} are joined, {:g} s apart (name one or some: {}:{}, {}:{}-{})", out.source,
        plural(joined.episodes.size(), "episode"), plural(out.times_s.size(), "frame"),
        kBetweenEpisodesS, source.folder.string(), joined.episodes.front()->index,
        source.folder.string(), joined.episodes.front()->index, joined.episodes[1]->index));
  }
  return out;
}

std::vector<double> joined_at_s(const JointSignals& signals) {
  std::vector<double> out;
  for (std::size_t row = 1; row < signals.times_s.size(); ++row)
    if (signals.episodes[row] != signals.episodes[row - 1]) out.push_back(signals.times_s[row]);
  return out;
}

CsvTable joint_table(const JointSignals& signals) {
  CsvTable out;
  out.source = signals.source;
  out.header = {"t"};
  std::vector<const Signal*> columns;
  const auto add = [&](Quantity quantity, const auto& name_of) {
    for (const Signal& signal : signals.signals) {
      if (signal.quantity != quantity) continue;
      out.header.push_back(name_of(signal.joint));
      columns.push_back(&signal);
    }
  };
  add(Quantity::kPosition, [](const std::string& joint) { return joint; });
  add(Quantity::kCommand, [](const std::string& joint) { return joint + kCommandEnding; });
  add(torque_quantity(signals), [](const std::string& joint) { return kTorquePrefix + joint; });
  for (std::size_t row = 0; row < signals.times_s.size(); ++row) {
    std::vector<std::string> cells{fmt::format("{}", signals.times_s[row])};
    for (const Signal* column : columns) cells.push_back(fmt::format("{}", column->values[row]));
    out.rows.push_back(std::move(cells));
    out.lines.push_back(row + 1);
  }
  return out;
}

ChannelTable channel_table(const JointSignals& signals) {
  ChannelTable out;
  out.source = signals.source;
  out.warnings = signals.warnings;
  out.names = {"t", "episode"};
  const auto rows = static_cast<Eigen::Index>(signals.times_s.size());
  out.values.resize(rows, static_cast<Eigen::Index>(2 + signals.signals.size()));
  for (Eigen::Index row = 0; row < rows; ++row) {
    const auto at = static_cast<std::size_t>(row);
    out.values(row, 0) = signals.times_s[at];
    out.values(row, 1) = static_cast<double>(signals.episodes[at]);
    out.lines.push_back(at + 1);
  }
  for (std::size_t i = 0; i < signals.signals.size(); ++i) {
    const Signal& signal = signals.signals[i];
    out.names.push_back(signal.joint + channel_ending(signal.quantity));
    out.values.col(static_cast<Eigen::Index>(2 + i)) =
        Eigen::Map<const Eigen::VectorXd>(signal.values.data(), rows);
  }
  return out;
}

TorqueNames torque_names(const Source& source, const std::string& channel,
                         const std::string& torque) {
  const std::string joint = torque.substr(std::min(torque.size(), kTorquePrefix.size()));
  const Plan plan = plan_of(look_into(source.folder));
  const bool is_effort = std::ranges::any_of(plan.elements, [&](const Element& element) {
    return element.quantity == Quantity::kEffort && element.joint == joint;
  });
  const bool is_command = channel.ends_with(kCommandEnding);
  const std::string moved =
      is_command ? channel.substr(0, channel.size() - kCommandEnding.size()) : channel;
  return {moved + channel_ending(is_command ? Quantity::kCommand : Quantity::kPosition),
          joint + channel_ending(is_effort ? Quantity::kEffort : Quantity::kCurrent)};
}

}  // namespace kinescope::datasets
