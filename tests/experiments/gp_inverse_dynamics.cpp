// SPDX-License-Identifier: Apache-2.0
//
// Robot kernels on a torque log with friction, accelerations given: nMSE of every joint on another
// trajectory, and what the training cost.
//   build/test/gp_inverse_dynamics [FOLDER below shared/data] [SAMPLES]
// The folder holds log.csv.gz, log_test.csv.gz and truth_log*.csv.gz
// (shared/data/synthetic_dynamics).
#include <algorithm>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <filesystem>
#include <sstream>
#include <string>
#include <vector>

#include "dynamics/gp/hyperparameters.h"
#include "dynamics/gp/lip_kernel.h"
#include "tests/truth/shared_data.h"

namespace kinescope::gp {
namespace {

using Eigen::Index;

// Numbers of a packed CSV file, header left out.
Eigen::MatrixXd read_packed(const std::filesystem::path& path) {
  std::string text;
  FILE* pipe = ::popen(("zcat '" + path.string() + "'").c_str(), "r");
  if (pipe == nullptr) return {};
  char buffer[65536];
  for (std::size_t got = 0; (got = std::fread(buffer, 1, sizeof buffer, pipe)) > 0;) {
    text.append(buffer, got);
  }
  ::pclose(pipe);
  std::istringstream lines(text);
  std::string line;
  std::getline(lines, line);
  const auto columns = std::ranges::count(line, ',') + 1;
  std::vector<double> values;
  while (std::getline(lines, line)) {
    for (const char* at = line.c_str(); *at != '\0';) {
      char* end = nullptr;
      values.push_back(std::strtod(at, &end));
      at = *end == ',' ? end + 1 : end;
    }
  }
  return Eigen::Map<Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>>(
      values.data(), static_cast<Index>(values.size()) / columns, columns);
}

struct Log {
  Dataset data;           // q dq ddq, measured torques
  Eigen::MatrixXd clean;  // torques without noise
};

Log read_log(const std::filesystem::path& folder, const std::string& suffix, Index samples) {
  const Eigen::MatrixXd log = read_packed(folder / ("log" + suffix + ".csv.gz"));
  const Eigen::MatrixXd truth = read_packed(folder / ("truth_log" + suffix + ".csv.gz"));
  const Index n = (log.cols() - 1) / 3;
  const Index stride = (log.rows() - 1) / (truth.rows() - 1);
  Log out{{Eigen::MatrixXd(samples, 3 * n), Eigen::MatrixXd(samples, n), {}, {}},
          Eigen::MatrixXd(samples, n)};
  for (Index i = 0; i < samples; ++i) {
    const Index row = i * truth.rows() / samples;
    out.data.inputs.row(i) << log.row(row * stride).segment(1, 2 * n), truth.row(row).segment(1, n);
    out.data.targets.row(i) = log.row(row * stride).tail(n);
    out.clean.row(i) = truth.row(row).tail(n);
  }
  return out;
}

Eigen::RowVectorXd nmse(const Eigen::MatrixXd& got, const Eigen::MatrixXd& truth) {
  const Eigen::MatrixXd centred = truth.rowwise() - truth.colwise().mean();
  return 100.0 * (got - truth).colwise().squaredNorm().array() /
         centred.colwise().squaredNorm().array();
}

class Stopwatch {
 public:
  [[nodiscard]] double cpu_s() const {
    return static_cast<double>(std::clock() - cpu_) / CLOCKS_PER_SEC;
  }
  [[nodiscard]] double wall_s() const {
    return std::chrono::duration<double>(std::chrono::steady_clock::now() - wall_).count();
  }

 private:
  std::clock_t cpu_ = std::clock();
  std::chrono::steady_clock::time_point wall_ = std::chrono::steady_clock::now();
};

void print_line(const char* name, const Eigen::MatrixXd& got, const Log& test,
                const Stopwatch& watch, int evaluations) {
  std::printf("%-12s", name);
  for (const double value : nmse(got, test.clean)) std::printf(" %7.3f", value);
  std::printf("   %8.1f %8.1f %5d\n", watch.cpu_s(), watch.wall_s(), evaluations);
  std::fflush(stdout);
}

// A step on all samples takes a second here: most of the way on fewer.
EstimateOptions lip_search() {
  return {.starts = 1, .max_iterations = 60, .relative_tolerance = 1e-6, .samples_for_starts = 150};
}

// One process for each joint.
template <typename MakeModel>
void run_independent(const char* name, const Log& train, const Log& test, MakeModel make) {
  const Stopwatch watch;
  Eigen::MatrixXd got(test.clean.rows(), test.clean.cols());
  int evaluations = 0;
  for (Index j = 0; j < test.clean.cols(); ++j) {
    const Dataset data{train.data.inputs, train.data.targets.col(j), {}, {}};
    const Estimate found = estimate_hyperparameters(make(data, static_cast<int>(j)), data);
    evaluations += found.evaluations;
    got.col(j) = predict(fit(found.model, data), test.data.inputs, {.variance = false}).mean;
  }
  print_line(name, got, test, watch, evaluations);
}

void run_lip(const Log& train, const Log& test, int n) {
  const Stopwatch watch;
  std::vector<Kernel> frictions;
  for (int j = 0; j < n; ++j) frictions.push_back(joint_friction(n, j));
  const JointKinds joints(static_cast<std::size_t>(n), JointKind::kRevolute);
  const GpModel model = make_model(lip(joints) + independent_outputs(frictions), 1e-3, {}, true);
  const Estimate found = estimate_hyperparameters(model, train.data, lip_search());
  const FittedGp fitted = fit(found.model, train.data);
  print_line("LIP", predict(fitted, test.data.inputs, {.variance = false}).mean, test, watch,
             found.evaluations);
}

int run(const std::filesystem::path& folder, Index samples) {
  const Log train = read_log(folder, "", samples);
  const Log test = read_log(folder, "_test", 1000);
  const int n = static_cast<int>(train.clean.cols());
  const JointKinds joints(static_cast<std::size_t>(n), JointKind::kRevolute);
  std::printf(
      "%s, %d samples; nMSE (%%) of each joint against torques without noise, another "
      "trajectory; CPU s, wall s, evaluations\n",
      folder.filename().c_str(), static_cast<int>(samples));
  run_independent("RBF", train, test, [n](const Dataset& data, int) {
    return make_model(rbf(first_columns(3 * n)), 1e-2, standardise(data));
  });
  run_independent("RBF+friction", train, test, [n](const Dataset& data, int j) {
    return make_model(rbf(first_columns(3 * n)) + joint_friction(n, j), 1e-2,
                      standardise_targets(data));
  });
  run_independent("GIP", train, test, [&joints, n](const Dataset& data, int j) {
    return make_model(gip(joints) + joint_friction(n, j), 1e-2, standardise_targets(data));
  });
  run_lip(train, test, n);
  return 0;
}

}  // namespace
}  // namespace kinescope::gp

int main(int argc, char** argv) {
  const std::string name = argc > 1 ? argv[1] : "synthetic_dynamics/wam7_coulomb_viscous";
  const auto folder = kinescope::shared_data(name);
  if (!folder) {
    std::printf("skipped: %s is not among the shared data\n", name.c_str());
    return 0;
  }
  return kinescope::gp::run(*folder, argc > 2 ? std::atoi(argv[2]) : 500);
}
