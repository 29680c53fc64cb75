// SPDX-License-Identifier: Apache-2.0
#include "app/commands/policy_seeds.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <limits>
#include <map>

#include <fmt/format.h>

#include "app/io/policy_files.h"
#include "app/report/experiment_plots.h"
#include "dynamics/models/json_reader.h"
#include "kinematics/core/file.h"

namespace kinescope {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;

constexpr double kNone = std::numeric_limits<double>::quiet_NaN();

/// One trial with a policy of one seed.
struct SeedTrial {
  int seed = 0;
  int trial = 0;
  double data_s = 0.0;
  double promised = 0.0;
  double paid = 0.0;
  bool judged = false;  ///< a position has a tolerance
  bool success = false;
};

/// Folders by their seeds.
std::map<int, fs::path> seed_folders(const fs::path& folder) {
  std::map<int, fs::path> out;
  std::error_code error;
  for (const fs::directory_entry& entry : fs::directory_iterator(folder, error)) {
    const std::string name = entry.path().filename().string();
    int seed = 0;
    if (!name.starts_with("seed_")) continue;
    const char* end = name.data() + name.size();
    if (std::from_chars(name.data() + 5, end, seed).ptr != end) continue;
    if (fs::exists(entry.path() / "policy_search.json", error)) out[seed] = entry.path();
  }
  return out;
}

void require_same(const fs::path& folder, const json& request) {
  const fs::path state = folder / "policy_state.json";
  const json asked = read_policy_request(state);
  for (const auto& [key, value] : request.items()) {
    if (key == "seed" || asked.value(key, json()) == value) continue;
    throw bad_input(state.string(), fmt::format("is of a search with another {}", key),
                    "keep the seeds of one search in a folder of their own");
  }
}

std::vector<SeedTrial> trials_of(int seed, const fs::path& folder) {
  const fs::path path = folder / "policy_search.json";
  const JsonReader read(path, "run its seed again with --force");
  json document;
  try {
    document = json::parse(read_text_file(path));
  } catch (const json::exception&) {
    throw read.wrong("is no JSON");
  }
  std::vector<SeedTrial> out;
  for (const json& trial : read.array(document, "trials")) {
    if (read.flag(trial, "explored")) continue;
    SeedTrial one{.seed = seed};
    one.trial = read.integer(read.at(trial, "trial"), "trial");
    one.data_s = read.number_at(trial, "data_s");
    one.promised = read.number_at(trial, "promised");
    one.paid = read.number_at(trial, "paid");
    one.judged = !read.at(trial, "success").is_null();
    one.success = one.judged && read.flag(trial, "success");
    out.push_back(one);
  }
  return out;
}

/// Of all seeds that came as far as one trial.
struct TrialCount {
  int seeds = 0;
  int in_trial = 0;
  int by_trial = 0;
  double data_s = 0.0;
  std::vector<double> paid;
};

std::map<int, TrialCount> counts_of(const std::map<int, std::vector<SeedTrial>>& seeds) {
  std::map<int, TrialCount> out;
  for (const auto& [seed, trials] : seeds) {
    bool done = false;
    for (const SeedTrial& one : trials) {
      done = done || one.success;
      TrialCount& count = out[one.trial];
      ++count.seeds;
      count.in_trial += one.success ? 1 : 0;
      count.by_trial += done ? 1 : 0;
      count.data_s = one.data_s;
      count.paid.push_back(one.paid);
    }
  }
  return out;
}

double median(std::vector<double> values) {
  std::ranges::sort(values);
  const std::size_t half = values.size() / 2;
  return values.size() % 2 == 1 ? values[half] : 0.5 * (values[half - 1] + values[half]);
}

ExperimentTable success_table(const std::map<int, TrialCount>& counts) {
  ExperimentTable out{"success",
                      "Seeds whose positions were within tolerance over the last second, with 95 % "
                      "interval",
                      {},
                      {"trial", "seeds", "learned from (s)", "in this trial (%)", "in from (%)",
                       "in to (%)", "by this trial (%)", "by from (%)", "by to (%)", "median cost"},
                      {}};
  for (const auto& [trial, count] : counts) {
    const ShareInterval in = share_interval(count.in_trial, count.seeds);
    const ShareInterval by = share_interval(count.by_trial, count.seeds);
    out.rows.push_back({{},
                        {static_cast<double>(trial), static_cast<double>(count.seeds), count.data_s,
                         100.0 * count.in_trial / count.seeds, 100.0 * in.lower, 100.0 * in.upper,
                         100.0 * count.by_trial / count.seeds, 100.0 * by.lower, 100.0 * by.upper,
                         median(count.paid)}});
  }
  return out;
}

ExperimentTable seeds_table(const std::map<int, std::vector<SeedTrial>>& seeds) {
  ExperimentTable out{"seeds",
                      "Every trial; success: 1 yes, 0 no",
                      {},
                      {"seed", "trial", "learned from (s)", "promised", "paid", "success"},
                      {}};
  for (const auto& [seed, trials] : seeds) {
    for (const SeedTrial& one : trials) {
      out.rows.push_back(
          {{},
           {static_cast<double>(seed), static_cast<double>(one.trial), one.data_s, one.promised,
            one.paid, one.judged ? (one.success ? 1.0 : 0.0) : kNone}});
    }
  }
  return out;
}

report::Curve success_curve(const std::map<int, TrialCount>& counts, const std::string& name,
                            int TrialCount::* successes) {
  report::Curve out{.name = name, .points = {}, .lower = {}, .upper = {}};
  for (const auto& [trial, count] : counts) {
    const ShareInterval interval = share_interval(count.*successes, count.seeds);
    out.points.emplace_back(trial, 100.0 * (count.*successes) / count.seeds);
    out.lower.push_back(100.0 * interval.lower);
    out.upper.push_back(100.0 * interval.upper);
  }
  return out;
}

std::string success_finding(const std::map<int, TrialCount>& counts) {
  std::string out = "Success by trial";
  for (const auto& [trial, count] : counts) {
    const ShareInterval interval = share_interval(count.by_trial, count.seeds);
    out += fmt::format("{} {}: {} of {} ({:.0f} to {:.0f} %)", out.back() == 'l' ? "" : ",", trial,
                       count.by_trial, count.seeds, 100.0 * interval.lower, 100.0 * interval.upper);
  }
  return out + ".";
}

}  // namespace

ShareInterval share_interval(int successes, int count) {
  if (count == 0) return {};
  constexpr double kZ = 1.959963984540054;  // of 95 %, two-sided
  const double n = count;
  const double share = successes / n;
  const double spread = kZ * std::sqrt(share * (1.0 - share) / n + kZ * kZ / (4.0 * n * n));
  const double centre = share + kZ * kZ / (2.0 * n);
  const double scale = 1.0 + kZ * kZ / n;
  return {std::max(0.0, (centre - spread) / scale), std::min(1.0, (centre + spread) / scale)};
}

std::string seed_folder_name(std::uint64_t seed) { return fmt::format("seed_{}", seed); }

ExperimentSummary policy_seeds_summary(const fs::path& folder, const json& request,
                                       const std::string& system) {
  std::map<int, std::vector<SeedTrial>> seeds;
  for (const auto& [seed, path] : seed_folders(folder)) {
    require_same(path, request);
    seeds[seed] = trials_of(seed, path);
  }
  const std::map<int, TrialCount> counts = counts_of(seeds);
  ExperimentSummary out;
  out.name = "policy_seeds";
  out.title = fmt::format("{}: policy search from {} seeds", system, seeds.size());
  for (const auto& [key, value] : request.items()) {
    if (key == "seed" || value.is_null()) continue;
    std::string name = key;
    std::ranges::replace(name, '_', ' ');
    out.settings.emplace_back(name, value.is_string() ? value.get<std::string>() : value.dump());
  }
  out.findings = {success_finding(counts)};
  out.tables = {success_table(counts), seeds_table(seeds)};
  ExperimentSection section{"success", "Success by trial", {}, {"success", "seeds"}, {}};
  section.figures.push_back(
      {report::curve_plot("Success over trials", {.label = "trial"}, {.label = "seeds, %"},
                          {success_curve(counts, "by this trial", &TrialCount::by_trial),
                           success_curve(counts, "in this trial", &TrialCount::in_trial)}),
       "Share of the seeds, with its 95 % interval (Wilson 1927)"});
  out.sections = {std::move(section)};
  return out;
}

}  // namespace kinescope
