// SPDX-License-Identifier: Apache-2.0
#include "dynamics/data/column_names.h"

#include <algorithm>
#include <cctype>
#include <map>
#include <numbers>
#include <set>

namespace kinescope {
namespace {

using Words = std::set<std::string, std::less<>>;

const std::map<std::string, LoggedQuantity, std::less<>>& quantity_words() {
  using enum LoggedQuantity;
  static const std::map<std::string, LoggedQuantity, std::less<>> kWords = {
      {"q", kPosition},
      {"pos", kPosition},
      {"position", kPosition},
      {"positions", kPosition},
      {"angle", kPosition},
      {"theta", kPosition},
      {"qpos", kPosition},
      {"jpos", kPosition},
      {"dq", kVelocity},
      {"qd", kVelocity},
      {"qdot", kVelocity},
      {"vel", kVelocity},
      {"velocity", kVelocity},
      {"velocities", kVelocity},
      {"speed", kVelocity},
      {"omega", kVelocity},
      {"qvel", kVelocity},
      {"dtheta", kVelocity},
      {"qp", kVelocity},
      {"ddq", kAcceleration},
      {"qdd", kAcceleration},
      {"qddot", kAcceleration},
      {"acc", kAcceleration},
      {"accel", kAcceleration},
      {"acceleration", kAcceleration},
      {"accelerations", kAcceleration},
      {"qacc", kAcceleration},
      {"qpp", kAcceleration},
      {"tau", kTorque},
      {"torque", kTorque},
      {"torques", kTorque},
      {"effort", kTorque},
      {"trq", kTorque},
      {"moment", kTorque},
      {"i", kCurrent},
      {"current", kCurrent},
      {"currents", kCurrent},
      {"cur", kCurrent},
      {"t", kTime},
      {"time", kTime},
      {"stamp", kTime},
      {"timestamp", kTime},
      {"times", kTime},
      {"rec", kTrajectory},
      {"run", kTrajectory},
      {"traj", kTrajectory},
      {"trajectory", kTrajectory},
      {"recording", kTrajectory},
      {"episode", kTrajectory},
      {"trial", kTrajectory},
      {"segment", kTrajectory}};
  return kWords;
}

bool is_sensor_word(std::string_view word) {
  static const Words kWords = {"sensor", "meas", "measured", "actual", "act", "msr"};
  return kWords.contains(word);
}

bool is_command_word(std::string_view word) {
  static const Words kWords = {"cmd",      "command", "commanded", "des",    "desired",
                               "d",        "ref",     "reference", "target", "goal",
                               "setpoint", "ctrl",    "control",   "sp"};
  return kWords.contains(word);
}

bool is_computed_word(std::string_view word) {
  static const Words kWords = {
      "model",       "est",     "estimated", "estimate", "pred",     "predicted", "rigid",
      "nominal",     "clean",   "friction",  "ext",      "external", "hat",       "error",
      "err",         "median",  "median40",  "tcp",      "tool",     "ee",        "cart",
      "cartesian",   "gravity", "enable",    "enabled",  "mode",     "status",    "temp",
      "temperature", "offset",  "std",       "limit",    "min",      "max"};
  return kWords.contains(word);
}

bool is_filler(std::string_view word) {
  static const Words kWords = {"state", "states", "j",     "filtered", "raw", "value",
                               "robot", "data",   "field", "header",   "msg", "joint_states"};
  return kWords.contains(word);
}

bool is_unit_word(std::string_view word) {
  static const Words kWords = {"deg", "degs", "degps", "rad",    "rads",    "mm",      "m",
                               "s",   "ms",   "us",    "ns",     "sec",     "nm",      "mnm",
                               "knm", "a",    "ma",    "degree", "degrees", "seconds", "radians"};
  return kWords.contains(word);
}

/// Of a rated torque or current: of anything else it is no unit.
bool is_percent(std::string_view word, LoggedQuantity quantity) {
  static const Words kWords = {"percent", "percentage", "pct", "perc"};
  return (quantity == LoggedQuantity::kTorque || quantity == LoggedQuantity::kCurrent) &&
         kWords.contains(word);
}

/// The names of a unit that unit_factor() knows.
std::string unit_name(std::string_view word) {
  static const std::map<std::string, std::string, std::less<>> kNames = {
      {"degs", "deg"},    {"degps", "deg"}, {"degree", "deg"}, {"degrees", "deg"}, {"rads", "rad"},
      {"radians", "rad"}, {"sec", "s"},     {"seconds", "s"},  {"nm", "Nm"},       {"mnm", "mNm"},
      {"knm", "kNm"},     {"a", "A"},       {"ma", "mA"}};
  const auto found = kNames.find(word);
  return found == kNames.end() ? std::string(word) : found->second;
}

enum class Glyph { kLetter, kDigit, kOther };

Glyph glyph(char c) {
  const auto byte = static_cast<unsigned char>(c);
  if (std::isdigit(byte) != 0) return Glyph::kDigit;
  return std::isalpha(byte) != 0 || byte > 127 ? Glyph::kLetter : Glyph::kOther;
}

/// A unit is the last word of the name, or stands straight before the joint's number ("q_deg1").
bool unit_may_stand(const std::vector<std::string>& words, std::size_t at) {
  if (at == 0) return false;
  if (at + 1 == words.size()) return true;
  return words[at].size() > 1 && at + 2 == words.size() && glyph(words[at + 1][0]) == Glyph::kDigit;
}

/// "deg_s", "rad_s_2", "mm_per_s": a rate's unit is all that is left of the name.
bool is_rate_unit(const std::vector<std::string>& words, std::size_t at, LoggedQuantity quantity) {
  static const Words kPerSecond = {"s", "sec", "per s", "per sec"};
  static const Words kPerSquare = {"s 2", "s s", "sec 2", "per s 2"};
  if (at == 0 || !is_unit_word(words[at])) return false;
  std::string behind;
  for (std::size_t w = at + 1; w < words.size(); ++w)
    behind += (behind.empty() ? "" : " ") + words[w];
  return (quantity == LoggedQuantity::kVelocity && kPerSecond.contains(behind)) ||
         (quantity == LoggedQuantity::kAcceleration && kPerSquare.contains(behind));
}

/// "q_dot_1" and "q_ddot_1" are derivatives.
LoggedQuantity differentiated(LoggedQuantity quantity, std::string_view word) {
  if (quantity != LoggedQuantity::kPosition) return quantity;
  return word == "dot" ? LoggedQuantity::kVelocity : LoggedQuantity::kAcceleration;
}

bool is_clock_name(const ColumnMeaning& meaning) {
  static const Words kClock = {"secs", "nsecs", "rel", "relative", "elapsed", "ros", "system"};
  return std::ranges::all_of(meaning.joint,
                             [](const std::string& word) { return kClock.contains(word); });
}

}  // namespace

std::string_view to_string(LoggedQuantity quantity) {
  switch (quantity) {
    using enum LoggedQuantity;
    case kTime:
      return "time";
    case kPosition:
      return "position";
    case kVelocity:
      return "velocity";
    case kAcceleration:
      return "acceleration";
    case kTorque:
      return "torque";
    case kCurrent:
      return "current";
    case kTrajectory:
      return "trajectory";
  }
  return "unknown";
}

std::vector<std::string> words_of(std::string_view name) {
  std::vector<std::string> words;
  Glyph before = Glyph::kOther;
  bool before_lower = false;
  std::size_t length = 0;
  for (const char c : name) {
    const Glyph now = glyph(c);
    const bool upper = std::isupper(static_cast<unsigned char>(c)) != 0;
    // jointPosition is two words, mA and tauJ are cut only where the word is long enough to be one.
    const bool camel = now == Glyph::kLetter && upper && before_lower && length >= 3;
    if (now != Glyph::kOther) {
      if (now != before || camel) {
        words.emplace_back();
        length = 0;
      }
      words.back() += static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
      ++length;
    }
    before = now;
    before_lower = now == Glyph::kLetter && !upper;
  }
  return words;
}

std::optional<ColumnMeaning> read_column_name(std::string_view name) {
  const std::vector<std::string> words = words_of(name);
  ColumnMeaning meaning;
  bool known = false;
  for (std::size_t w = 0; w < words.size(); ++w) {
    const std::string& word = words[w];
    const auto quantity = quantity_words().find(word);
    if (!known && quantity != quantity_words().end()) {
      meaning.quantity = quantity->second;
      known = true;
    } else if (known && (word == "dot" || word == "ddot")) {
      meaning.quantity = differentiated(meaning.quantity, word);
    } else if (is_sensor_word(word)) {
      if (meaning.origin == LoggedOrigin::kPlain) meaning.origin = LoggedOrigin::kSensor;
    } else if (is_computed_word(word)) {
      meaning.origin = LoggedOrigin::kComputed;
    } else if (is_command_word(word)) {
      if (meaning.origin != LoggedOrigin::kComputed) meaning.origin = LoggedOrigin::kCommanded;
    } else if (known && is_rate_unit(words, w, meaning.quantity)) {
      meaning.unit = unit_name(word);
      break;
    } else if (is_unit_word(word) && unit_may_stand(words, w)) {
      meaning.unit = unit_name(word);
    } else if (known && is_percent(word, meaning.quantity)) {
      meaning.unit = "%";
    } else if (!is_filler(word)) {
      meaning.joint.push_back(word);
    }
  }
  if (!known) return std::nullopt;
  const bool whole_log =
      meaning.quantity == LoggedQuantity::kTime || meaning.quantity == LoggedQuantity::kTrajectory;
  if (whole_log && !is_clock_name(meaning)) return std::nullopt;
  return meaning;
}

std::optional<double> unit_factor(std::string_view unit) {
  constexpr double kDegree = std::numbers::pi / 180.0;
  static const std::map<std::string, double, std::less<>> kFactors = {
      {"rad", 1.0},       {"deg", kDegree}, {"m", 1.0},     {"mm", 1e-3},     {"rad/s", 1.0},
      {"deg/s", kDegree}, {"m/s", 1.0},     {"mm/s", 1e-3}, {"rad/s^2", 1.0}, {"deg/s^2", kDegree},
      {"m/s^2", 1.0},     {"mm/s^2", 1e-3}, {"s", 1.0},     {"ms", 1e-3},     {"us", 1e-6},
      {"ns", 1e-9},       {"Nm", 1.0},      {"N", 1.0},     {"mNm", 1e-3},    {"kNm", 1e3},
      {"A", 1.0},         {"mA", 1e-3},     {"%", 1.0}};
  const auto found = kFactors.find(unit);
  if (found == kFactors.end()) return std::nullopt;
  return found->second;
}

}  // namespace kinescope
