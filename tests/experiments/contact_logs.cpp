// SPDX-License-Identifier: Apache-2.0
//
// `kinescope contact` as a user runs it, on recordings whose contacts are known: a UR5 driven into
// an obstacle, measured robots that nothing touched (cut by trajectory), and simulated ones.
#include <algorithm>
#include <cstdio>
#include <functional>
#include <sstream>
#include <string>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "app/torque/find_contacts.h"
#include "dynamics/experiments/contact_world.h"
#include "dynamics/experiments/reference_arms.h"
#include "kinematics/core/error.h"
#include "kinematics/core/file.h"
#include "kinematics/urdf/dynamic_urdf.h"
#include "tests/experiments/contact_sets.h"
#include "tests/experiments/real_logs.h"
#include "tests/experiments/torque_robots.h"
#include "tests/truth/drive_world.h"
#include "tests/truth/shared_data.h"
#include "tests/truth/temporary_path.h"

namespace kinescope {
namespace {

using namespace experiments;

namespace fs = std::filesystem;

class Folder {
 public:
  Folder() : path_(truth::temporary_path("contact_logs")) {
    fs::remove_all(path_);
    fs::create_directories(path_);
  }
  ~Folder() { fs::remove_all(path_); }
  Folder(const Folder&) = delete;
  Folder& operator=(const Folder&) = delete;
  [[nodiscard]] fs::path operator/(const std::string& name) const { return path_ / name; }

 private:
  fs::path path_;
};

fs::path write_log(const Folder& folder, const std::string& name, const TorqueLog& log) {
  const char* torque = log.torque_unit == "A" ? "i" : "tau";
  std::string text = "t";
  for (const auto& [prefix, columns] :
       {std::pair{"q", log.q.cols()}, std::pair{"dq", log.dq.cols()},
        std::pair{torque, log.torque.cols()}}) {
    for (Eigen::Index j = 1; j <= columns; ++j) text += fmt::format(",{}{}", prefix, j);
  }
  text += "\n";
  for (Eigen::Index t = 0; t < log.rows(); ++t) {
    text += fmt::format("{:.9g}", log.t_s[t]);
    for (const Eigen::MatrixXd* m : {&log.q, &log.dq, &log.torque}) {
      for (Eigen::Index j = 0; j < m->cols(); ++j) text += fmt::format(",{:.9g}", (*m)(t, j));
    }
    text += "\n";
  }
  write_file_atomically(folder / name, text);
  return folder / name;
}

struct Found {
  std::vector<DetectedContact> events;
  std::vector<double> alarms_s;
  double length_s = 0.0;
  std::string refused;
};

Found look(const Folder& folder, const fs::path& log, const std::vector<fs::path>& learn,
           const fs::path& robot, const Eigen::Vector3d& gravity_m_s2,
           const std::string& model = {}) {
  Found out;
  ContactCommandOptions options;
  options.model = model;
  options.logs = {log};
  options.learn_logs = learn;
  options.robot = robot;
  options.output = folder / "out";
  options.force = true;
  options.gravity_m_s2 = gravity_m_s2;
  try {
    const ContactSummary summary = find_contacts(options);
    for (const ContactEvent& event : summary.events) {
      out.events.push_back({.alarm_s = summary.clock.time_s(event.alarm_s),
                            .end_s = summary.clock.time_s(event.end_s),
                            .onset_s = summary.clock.time_s(event.onset_s),
                            .link = event.link});
    }
    out.length_s = summary.t_s[summary.t_s.size() - 1] - summary.t_s[0];
  } catch (const Error& error) {
    out.refused = fmt::format("exit {}: {}", static_cast<int>(error.code()), error.what());
  }
  return out;
}

std::string words(const Found& found) {
  if (!found.refused.empty()) return found.refused.substr(0, 90);
  std::string out;
  for (const DetectedContact& event : found.events) {
    out += fmt::format(" {:.2f}(alarm {:.2f})-{:.2f}", event.onset_s, event.alarm_s, event.end_s);
  }
  return out;
}

// --- A UR5 against an obstacle

constexpr std::array kUr5Files{"base_sweep_1degps_1", "base_sweep_1degps_2", "base_sweep_3degps_1",
                               "base_sweep_3degps_2", "base_sweep_5degps_1", "base_sweep_5degps_2",
                               "base_sweep_7degps_1", "base_sweep_7degps_2", "impact_4degps_1",
                               "impact_4degps_2",     "impact_4degps_3"};
/// The obstacle stands at about -88.5 deg: contact is not before this.
constexpr double kBeforeObstacle_deg = -89.0;

DynamicModel ur5_kinematics() {
  return dh_arm({{0, 0, 0.089159},
                 {0, kQuarterTurn, 0},
                 {-0.425, 0, 0},
                 {-0.39225, 0, 0.10915},
                 {0, kQuarterTurn, 0.09465},
                 {0, -kQuarterTurn, 0.0823}});
}

// The part of a sweep before the obstacle, for certain: the first 60 %.
std::vector<fs::path> free_parts(const Folder& folder, const fs::path& set,
                                 const std::vector<std::string>& names) {
  std::vector<fs::path> out;
  for (const std::string& name : names) {
    std::vector<std::string> lines;
    std::istringstream text(read_text_file(set / (name + ".csv")));
    for (std::string line; std::getline(text, line);) lines.push_back(line);
    lines.resize(lines.size() * 6 / 10);
    write_file_atomically(folder / (name + "_free.csv"),
                          fmt::format("{}\n", fmt::join(lines, "\n")));
    out.push_back(folder / (name + "_free.csv"));
  }
  return out;
}

// `learn`: sweeps whose free parts are learned from, and which are not looked at; none: each file
// from itself. `torque_model`: as --model.
void ur5_table(const fs::path& set, const char* title, const DynamicModel& model,
               const std::vector<std::string>& learn = {}, const std::string& torque_model = {}) {
  const Folder folder;
  write_file_atomically(folder / "robot.urdf", write_urdf(model));
  std::printf("ur5_contact, %s\n", title);
  int found_all = 0;
  int invented_all = 0;
  int repeated_all = 0;
  int looked_at = 0;
  const std::vector<fs::path> free = free_parts(folder, set, learn);
  for (const char* name : kUr5Files) {
    if (std::ranges::find(learn, name) != learn.end()) continue;
    ++looked_at;
    const ChannelTable table = read_channel_table(set / (std::string(name) + ".csv"));
    const Eigen::VectorXd t_s = 1e-3 * table.values.col(*table.column("t_ms"));
    const Eigen::VectorXd q_deg = table.values.col(*table.column("q_deg1"));
    Eigen::Index at = 0;
    while (q_deg[at] < kBeforeObstacle_deg) ++at;
    const Found found = look(folder, set / (std::string(name) + ".csv"), free,
                             folder / "robot.urdf", {0.0, 0.0, -kUsualGravity_m_s2}, torque_model);
    int hits = 0;
    int invented = 0;
    for (const DetectedContact& event : found.events) {
      ++(event.alarm_s >= t_s[at] ? hits : invented);
    }
    found_all += hits > 0 ? 1 : 0;
    invented_all += invented;
    repeated_all += std::max(0, hits - 1);
    std::printf("  %-20s obstacle %6.2f to %6.2f s: found %s, invented %d |%s\n", name, t_s[at],
                t_s[t_s.size() - 1], hits > 0 ? "yes" : "NO", invented, words(found).c_str());
  }
  std::printf("  found %d of %d, invented %d, reported again %d\n", found_all, looked_at,
              invented_all, repeated_all);
  std::fflush(stdout);
}

// --- Measured robots that nothing touched

struct FreeSet {
  std::string name;
  DynamicModel model;
  std::vector<TorqueLog> parts;  ///< the first to learn from
  fs::path urdf = {};            ///< as published; empty: the model
};

std::vector<TorqueLog> halves(const TorqueLog& log) {
  const double middle = 0.5 * (log.t_s[0] + log.t_s[log.rows() - 1]);
  return {rows_between(log, log.t_s[0], middle),
          rows_between(log, middle, log.t_s[log.rows() - 1])};
}

TorqueLog in_amperes(TorqueLog log) {
  log.torque_unit = "A";
  return log;
}

std::vector<TorqueLog> ur10e_parts(const fs::path& set, const std::vector<std::string>& files) {
  std::vector<TorqueLog> out;
  for (const std::string& file : files) out.push_back(in_amperes(read_log(set / file, 6, "i")));
  return out;
}

TorqueLog iiwa_log(const fs::path& set) {
  constexpr double kRate_hz = 50.0;
  const ChannelTable table = read_channel_table(set / "iiwa14_samples.csv");
  TorqueLog log;
  log.t_s = Eigen::VectorXd::LinSpaced(table.rows(), 0.0,
                                       static_cast<double>(table.rows() - 1) / kRate_hz);
  log.q = columns(table, "q", 7);
  log.dq = columns(table, "dq", 7);
  log.torque = columns(table, "tau", 7);
  log.trajectory = Eigen::VectorXi::Zero(log.rows());
  log.trajectory_names = {"iiwa"};
  log.source.assign(static_cast<std::size_t>(log.rows()), 0);
  log.lines = table.lines;
  for (int j = 1; j <= 7; ++j) log.joints.push_back({.name = fmt::format("joint{}", j)});
  log.sources = {"iiwa"};
  return log;
}

DynamicModel iiwa_kinematics() {
  return dh_arm({{0, 0, 0.36},
                 {0, -kQuarterTurn, 0},
                 {0, kQuarterTurn, 0.42},
                 {0, kQuarterTurn, 0},
                 {0, -kQuarterTurn, 0.4},
                 {0, -kQuarterTurn, 0},
                 {0, kQuarterTurn, 0.126}});
}

/// One constant speed after another, start-up included.
std::vector<TorqueLog> kinova_parts(const fs::path& set) {
  constexpr double kRate_hz = 999.0;
  std::vector<TorqueLog> out;
  for (const char* speed : {"0.10", "0.05", "0.30", "0.50", "0.70", "0.90", "1.30", "1.50"}) {
    const ChannelTable table =
        read_channel_table(set / fmt::format("const_velocity_{}.csv", speed));
    TorqueLog log;
    log.t_s = Eigen::VectorXd::LinSpaced(table.rows(), 0.0,
                                         static_cast<double>(table.rows() - 1) / kRate_hz);
    log.q = table.values.col(*table.column("q"));
    for (Eigen::Index t = 1; t < log.rows(); ++t) {
      const double step = log.q(t, 0) - log.q(t - 1, 0);
      log.q(t, 0) -= 4.0 * kQuarterTurn * std::round(step / (4.0 * kQuarterTurn));
    }
    log.torque = table.values.col(*table.column("i_meas"));
    log.torque_unit = "A";
    out.push_back(std::move(log));
  }
  return out;
}

std::vector<TorqueLog> pendulum_parts(const fs::path& set) {
  const TorqueLog all = pendulum_log(set, "sts3215", 1.1682, 0.1).log;
  const std::vector<Eigen::Index> bounds = all.bounds();
  std::vector<TorqueLog> out;
  for (std::size_t k = 0; k + 1 < bounds.size() && k < 8; ++k) {
    std::vector<char> keep(static_cast<std::size_t>(all.rows()), 0);
    for (Eigen::Index t = bounds[k]; t < bounds[k + 1]; ++t) keep[static_cast<std::size_t>(t)] = 1;
    out.push_back(keep_rows(all, keep));
  }
  return out;
}

struct NamedFreeSet {
  const char* folder;
  std::function<FreeSet(const fs::path&)> make;
};

std::vector<NamedFreeSet> free_sets() {
  return {
      {"dynamics/ur10e_innopolis",
       [](const fs::path& set) {
         return FreeSet{"UR10e, currents", read_dynamic_urdf(set / "ur10e.urdf"),
                        ur10e_parts(set, {"ident_12harm_50s.csv", "ident_12harm_30s.csv",
                                          "ident_12harm_40s.csv", "ident_15harm_50s_unloaded.csv",
                                          "ident_7harm_20s.csv"}),
                        set / "ur10e.urdf"};
       }},
      {"dynamics/ur10e_innopolis",
       [](const fs::path& set) {
         return FreeSet{
             "UR10e, joint by joint", read_dynamic_urdf(set / "ur10e.urdf"),
             ur10e_parts(set, {"jointwise_1.csv.gz", "jointwise_2.csv.gz", "jointwise_4.csv.gz"}),
             set / "ur10e.urdf"};
       }},
      {"dynamics/ur10e_innopolis",
       [](const fs::path& set) {
         return FreeSet{
             "UR10e, at rest", read_dynamic_urdf(set / "ur10e.urdf"),
             ur10e_parts(set, {"static_pose_p1.csv", "static_pose_p2.csv", "static_pose_p3.csv"}),
             set / "ur10e.urdf"};
       }},
      {"dynamics/tx40_staubli",
       [](const fs::path& set) {
         return FreeSet{"TX40", read_dynamic_urdf(set / "tx40_mdh_modified.urdf"),
                        halves(rows_between(tx40_log(set), 0.1, 7.5)),
                        set / "tx40_mdh_modified.urdf"};
       }},
      {"dynamics/panda_gaz2019",
       [](const fs::path& set) {
         return FreeSet{"Panda", panda_kinematics(), halves(panda_log(set))};
       }},
      {"dynamics/rokae_ar5",
       [](const fs::path& set) {
         FreeSet out{"Rokae AR5", read_dynamic_urdf(set / "AR5-5_07R-W4C4A2.urdf"),
                     halves(rokae_log(set)), set / "AR5-5_07R-W4C4A2.urdf"};
         out.model.gravity_m_s2 = {kUsualGravity_m_s2, 0.0, 0.0};
         return out;
       }},
      {"dynamics/kuka_lwr4",
       [](const fs::path& set) {
         return FreeSet{"KUKA LWR4+",
                        read_dynamic_urdf(set / "kuka_lwr4.urdf"),
                        {lwr4_log(set, 1), lwr4_log(set, 2)},
                        set / "kuka_lwr4.urdf"};
       }},
      {"dynamics/iiwa14_lasa",
       [](const fs::path& set) {
         return FreeSet{"iiwa 14", iiwa_kinematics(), halves(iiwa_log(set))};
       }},
      {"dynamics/franka_fairino_friction",
       [](const fs::path& set) {
         return FreeSet{"Franka joint 2",
                        lone_joint(),
                        {franka_log(set, "franka_case3_middle_joint2.csv.gz", 2),
                         franka_log(set, "franka_case3_slow_joint2.csv.gz", 2),
                         franka_log(set, "franka_case3_high_joint2.csv.gz", 2)}};
       }},
      {"dynamics/franka_fairino_friction",
       [](const fs::path& set) {
         return FreeSet{"Franka joint 7", lone_joint(),
                        halves(franka_log(set, "franka_case4_slow_joint7.csv.gz", 7))};
       }},
      {"dynamics/franka_fairino_friction",
       [](const fs::path& set) {
         return FreeSet{"Fairino joint 3",
                        lone_joint(),
                        {franka_log(set, "fairino_S_slow_joint3.csv.gz", 3),
                         franka_log(set, "fairino_line_slow_joint3.csv.gz", 3)}};
       }},
      {"dynamics/kinova_gen3_joint7",
       [](const fs::path& set) {
         return FreeSet{"Kinova joint 7, starts", lone_joint(), kinova_parts(set)};
       }},
      {"dynamics/feetech_pendulum",
       [](const fs::path& set) {
         return FreeSet{"Feetech pendulum", pendulum(), pendulum_parts(set)};
       }},
  };
}

struct Count {
  int alarms = 0;
  int refused = 0;
  double length_s = 0.0;
  std::string last;

  void add(const Found& found) {
    alarms += static_cast<int>(found.events.size());
    refused += found.refused.empty() ? 0 : 1;
    length_s += found.length_s;
    if (!found.refused.empty() || !found.events.empty()) last = words(found);
  }
};

void print_count(const char* name, const char* how, const Count& count) {
  std::printf("  %-24s %-16s %7.1f s: invented %3d, refused %d |%s\n", name, how, count.length_s,
              count.alarms, count.refused, count.last.substr(0, 100).c_str());
  std::fflush(stdout);
}

}  // namespace

void contact_logs_ur5() {
  const auto set = shared_data("dynamics/ur5_contact");
  if (!set) {
    std::printf("ur5_contact: not on this machine\n");
    return;
  }
  ur5_table(*set, "all six joints", ur5_kinematics());
  ur5_table(*set, "joint 1 alone", lone_joint());
}

void contact_logs_model(const char* model) {
  const std::vector<std::string> sweeps{"base_sweep_1degps_1", "base_sweep_3degps_1",
                                        "base_sweep_5degps_1", "base_sweep_7degps_1"};
  if (const auto set = shared_data("dynamics/ur5_contact")) {
    for (const char* method : {"", model}) {
      const std::string name = *method != 0 ? method : "momentum";
      ur5_table(*set, ("from itself, by " + name).c_str(), ur5_kinematics(), {}, method);
      ur5_table(*set, ("learned from free sweeps, by " + name).c_str(), ur5_kinematics(), sweeps,
                method);
    }
  }
  contact_logs_free(model);
}

void contact_logs_free(const char* model) {
  std::printf("measured, nothing touched%s%s\n", *model != 0 ? ", by " : "", model);
  for (const NamedFreeSet& named : free_sets()) {
    const auto folder = shared_data(named.folder);
    if (!folder) {
      std::printf("  %s: not on this machine\n", named.folder);
      continue;
    }
    const FreeSet set = named.make(*folder);
    const Folder work;
    const fs::path robot = set.urdf.empty() ? work / "robot.urdf" : set.urdf;
    if (set.urdf.empty()) write_file_atomically(robot, write_urdf(set.model));
    std::vector<fs::path> logs;
    for (std::size_t k = 0; k < set.parts.size(); ++k) {
      logs.push_back(write_log(work, fmt::format("part{}.csv", k), set.parts[k]));
    }
    Count apart;
    Count itself;
    for (std::size_t k = 0; k < logs.size(); ++k) {
      const auto judge = [&](const std::vector<fs::path>& learn) {
        return look(work, logs[k], learn, robot, set.model.gravity_m_s2, model);
      };
      if (k > 0) apart.add(judge({logs[0]}));
      itself.add(judge({}));
    }
    print_count(set.name.c_str(), "learned apart", apart);
    print_count(set.name.c_str(), "from itself", itself);
  }
}

namespace {

// Sweeps of joint 1 into an obstacle, whose torque rises to so much in 0.4 s.
void sweeps_into_obstacles(double obstacle_nm) {
  constexpr int kSweeps = 10;
  constexpr double kObstacle_s = 10.0;
  for (const bool masses : {true, false}) {
    const Folder work;
    const DynamicModel model = contact_arm(3);
    write_file_atomically(work / "robot.urdf",
                          write_urdf(masses ? model : without_masses(model.tree)));
    int hits = 0;
    int invented = 0;
    int refused = 0;
    for (int w = 0; w < kSweeps; ++w) {
      Rng rng = Rng::from_name("sweep", static_cast<std::uint64_t>(w));
      TorqueLog log;
      const TorqueSamples samples = drive_world(model,
                                                {.speed_rad_s = rng.uniform(0.03, 0.15),
                                                 .one_way = true,
                                                 .obstacle_s = kObstacle_s,
                                                 .obstacle_nm = obstacle_nm},
                                                rng)
                                        .samples;
      log.t_s = samples.t_s;
      log.q = samples.q;
      log.dq = samples.dq;
      log.torque = samples.torque;
      const Found found =
          look(work, write_log(work, "log.csv", log), {}, work / "robot.urdf", model.gravity_m_s2);
      bool hit = false;
      for (const DetectedContact& event : found.events) {
        hit = hit || event.alarm_s >= kObstacle_s;
        invented += event.alarm_s >= kObstacle_s ? 0 : 1;
      }
      hits += hit ? 1 : 0;
      refused += found.refused.empty() ? 0 : 1;
    }
    std::printf("  obstacle of %.1f N m, %s: found %d of %d, invented %d, refused %d\n",
                obstacle_nm, masses ? "masses known" : "identified", hits, kSweeps, invented,
                refused);
    std::fflush(stdout);
  }
}

}  // namespace

void contact_logs_simulated() {
  std::printf("simulated, %s\n", "a minute each");
  constexpr int kMinutes = 20;
  for (const bool masses : {true, false}) {
    for (const std::string kind : {"sines", "stop and go", "slow, stop and go", "winds up"}) {
      const Folder work;
      DynamicModel model = contact_arm(3);
      Count count;
      for (int w = 0; w < kMinutes / 2; ++w) {
        Rng rng = Rng::from_name(kind, static_cast<std::uint64_t>(w));
        TorqueSamples samples;
        if (kind == "sines") {
          samples = contact_world(model, {.duration_s = 60.0, .rate_hz = 250.0}, rng).samples;
        } else {
          DriveWorldOptions drives{.duration_s = 60.0,
                                   .speed_rad_s = kind == "slow, stop and go" ? 0.08 : 0.8};
          if (kind == "winds up") drives.presliding_rad = 5e-3;
          samples = drive_world(model, drives, rng).samples;
        }
        TorqueLog log;
        log.t_s = samples.t_s;
        log.q = samples.q;
        log.dq = samples.dq;
        log.torque = samples.torque;
        write_file_atomically(work / "robot.urdf",
                              write_urdf(masses ? model : without_masses(model.tree)));
        count.add(look(work, write_log(work, "log.csv", log), {}, work / "robot.urdf",
                       model.gravity_m_s2));
      }
      print_count(kind.c_str(), masses ? "masses known" : "identified", count);
    }
  }
  for (const double obstacle_nm : {0.5, 1.0, 3.0}) sweeps_into_obstacles(obstacle_nm);
}

}  // namespace kinescope
