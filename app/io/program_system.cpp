// SPDX-License-Identifier: Apache-2.0
#include "app/io/program_system.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <optional>
#include <utility>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "app/io/line_program.h"
#include "dynamics/policy/systems/simulated_system.h"
#include "kinematics/core/csv.h"
#include "kinematics/core/error.h"

namespace kinescope {
namespace {

using Eigen::Index;
using policy::StateLayout;

std::vector<std::string> state_columns(const StateLayout& layout, bool with_speeds) {
  std::vector<std::string> out = layout.positions;
  if (!with_speeds) return out;
  for (const std::string& name : layout.positions) out.push_back(name + "_speed");
  return out;
}

std::vector<std::string> cells_of(const std::string& line) {
  std::vector<std::string> out(1);
  for (const char c : line) {
    if (c == ',') {
      out.emplace_back();
    } else if (c != ' ' && c != '\t') {
      out.back() += c;
    }
  }
  return out;
}

// One rollout of a program: what it says, and what is wrong with it.
class Conversation {
 public:
  Conversation(const ProgramCall& call, const std::vector<std::string>& words)
      : name_(fmt::format("{}", fmt::join(call.words, " "))),
        timeout_s_(call.timeout_s),
        program_(words, call.folder, call.timeout_s) {}

  LineProgram& program() { return program_; }

  /// The next line; nothing where its output has ended.
  std::optional<std::string> line(
      const std::string& what,
      std::string_view remedy = "flush its standard output after every line, or raise timeout") {
    std::string out;
    const LineProgram::Answer answer = program_.read(out);
    if (answer == LineProgram::Answer::kLine) return out;
    if (answer == LineProgram::Answer::kEnd) return std::nullopt;
    throw undetermined(name_, fmt::format("wrote no {} within {:g} s", what, timeout_s_), remedy);
  }
  std::string require_line(const std::string& what) {
    if (auto out = line(what)) return *out;
    const std::optional<std::string> end = program_.wait_for_end();
    throw undetermined(name_,
                       fmt::format("{} before its {}{}", end.value_or("ended"), what, words()),
                       "let it answer every input with a state");
  }
  /// The order of the columns in the table.
  std::vector<Index> order_of(const std::string& header, const std::vector<std::string>& columns) {
    const std::vector<std::string> names = cells_of(header);
    std::vector<Index> out;
    for (const std::string& column : columns) {
      const auto found = std::ranges::find(names, column);
      if (found == names.end() || names.size() != columns.size()) {
        throw bad_input(name_, fmt::format("its columns are {}", header),
                        fmt::format("let it write {} first", fmt::join(columns, ",")));
      }
      out.push_back(found - names.begin());
    }
    return out;
  }
  Eigen::VectorXd numbers(const std::string& row, const std::vector<Index>& order,
                          const std::vector<std::string>& columns, const std::string& what) {
    const std::vector<std::string> cells = cells_of(row);
    if (cells.size() != columns.size()) {
      throw bad_input(name_, fmt::format("its {} is '{:.80}'", what, row),
                      fmt::format("write {} numbers separated by commas", columns.size()));
    }
    Eigen::VectorXd out(std::ssize(columns));
    for (std::size_t c = 0; c < columns.size(); ++c) {
      const std::string& cell = cells[static_cast<std::size_t>(order[c])];
      const std::optional<double> value = parse_number(cell);
      if (!value || !std::isfinite(*value)) {
        throw undetermined(name_, fmt::format("{} is '{:.40}' in its {}", columns[c], cell, what),
                           "let it write finite numbers only");
      }
      out[static_cast<Index>(c)] = *value;
    }
    return out;
  }
  void require_good_end() {
    if (const auto end = program_.wait_for_end()) {
      throw undetermined(name_, fmt::format("{} after its rollout{}", *end, words()),
                         "let it end with exit code 0 when its input ends");
    }
  }

 private:
  std::string words() {
    const std::string last = program_.last_words();
    return last.empty() ? std::string() : fmt::format(": {:.200}", last);
  }

  std::string name_;
  double timeout_s_;
  LineProgram program_;
};

// Whole turns are no motion.
void unwrap(const StateLayout& layout, const Eigen::VectorXd& last, Eigen::VectorXd& state) {
  constexpr double kTurn = 2.0 * std::numbers::pi;
  for (Index p = 0; p < layout.position_count(); ++p) {
    if (!layout.is_angle[static_cast<std::size_t>(p)]) continue;
    state[p] += kTurn * std::round((last[p] - state[p]) / kTurn);
  }
}

std::string input_row(const Eigen::VectorXd& input) {
  std::string out;
  for (const double value : input) out += fmt::format("{}{:.17g}", out.empty() ? "" : ",", value);
  return out;
}

// A table after the rollout: the same rows, by filters that know the future.
std::optional<Eigen::MatrixXd> smoothed_table(Conversation& talk, const StateLayout& layout,
                                              int rows) {
  const auto rest = [&talk] {
    return talk.line("end of its output", "let it end when its input ends, or raise timeout");
  };
  std::optional<std::string> header = rest();
  while (header && header->empty()) header = rest();
  if (!header) return std::nullopt;
  const std::vector<std::string> columns = state_columns(layout, true);
  const std::vector<Index> order = talk.order_of(*header, columns);
  Eigen::MatrixXd out(rows, std::ssize(columns));
  for (int k = 0; k < rows; ++k) {
    const std::string what = fmt::format("smoothed state {} of {}", k + 1, rows);
    Eigen::VectorXd state = talk.numbers(talk.require_line(what), order, columns, what);
    if (k > 0) unwrap(layout, out.row(k - 1), state);
    out.row(k) = state;
  }
  while (rest()) {
  }
  return out;
}

}  // namespace

ProgramSystem::ProgramSystem(StateLayout layout, policy::SensingOptions sensing, ProgramCall call)
    : layout_(std::move(layout)), sensing_(std::move(sensing)), call_(std::move(call)) {
  policy::check_layout(layout_);
  policy::check_sensing(sensing_, layout_);
}

policy::Trial ProgramSystem::run(const policy::Controller& controller, int steps,
                                 std::uint64_t seed, int trial) const {
  const Index count = layout_.position_count();
  const bool full = sensing_.sensing == policy::Sensing::kFullState;
  const std::vector<std::string> columns = state_columns(layout_, full);
  std::vector<std::string> words = call_.words;
  words.insert(words.end(), {"--steps", fmt::format("{}", steps), "--trial",
                             fmt::format("{}", trial), "--seed", fmt::format("{}", seed)});
  Conversation talk(call_, words);
  talk.program().write_line(fmt::format("{}", fmt::join(layout_.inputs, ",")));
  const std::vector<Index> order = talk.order_of(talk.require_line("columns"), columns);
  policy::OnlineFilter filter(layout_, sensing_);
  Eigen::MatrixXd positions(steps + 1, count);
  policy::Trial out{.seen = Eigen::MatrixXd(steps + 1, 2 * count),
                    .smoothed = {},
                    .truth = {},
                    .inputs = Eigen::MatrixXd(steps, layout_.input_count())};
  for (int k = 0; k <= steps; ++k) {
    const std::string what = fmt::format("state {} of {}", k + 1, steps + 1);
    Eigen::VectorXd measured = Eigen::VectorXd::Zero(2 * count);
    measured.head(std::ssize(columns)) =
        talk.numbers(talk.require_line(what), order, columns, what);
    if (k > 0) unwrap(layout_, positions.row(k - 1), measured);
    positions.row(k) = measured.head(count);
    out.seen.row(k) = filter.step(measured);
    if (k == steps) break;
    const Eigen::VectorXd input = policy::limited_input(controller, out.seen.row(k), k, layout_);
    out.inputs.row(k) = input;
    talk.program().write_line(input_row(input));
  }
  talk.program().close_input();
  const std::optional<Eigen::MatrixXd> smoothed = smoothed_table(talk, layout_, steps + 1);
  talk.require_good_end();
  out.smoothed = smoothed ? *smoothed
                          : policy::smoothed_signal(out.seen, positions, layout_, sensing_.sensing,
                                                    call_.smoothing_cutoff_hz);
  return out;
}

}  // namespace kinescope
