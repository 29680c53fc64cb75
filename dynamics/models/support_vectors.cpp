// SPDX-License-Identifier: Apache-2.0
#include "dynamics/models/support_vectors.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <vector>

#include <libsvm/svm.h>

#include "dynamics/data/splits.h"
#include "dynamics/models/standardised.h"
#include "kinematics/core/error.h"

namespace kinescope::models {
namespace {

constexpr int kSearchFolds = 4;
constexpr Eigen::Index kSearchSamples = 500;
constexpr double kCacheMegabytes = 200.0;

// LIBSVM's way to store samples; the model keeps pointers into it.
class Problem {
 public:
  Problem(const Eigen::MatrixXd& inputs, const Eigen::VectorXd& targets)
      : nodes_(static_cast<std::size_t>(inputs.rows() * (inputs.cols() + 1))),
        rows_(static_cast<std::size_t>(inputs.rows())),
        targets_(targets.data(), targets.data() + targets.size()) {
    const auto width = static_cast<std::size_t>(inputs.cols() + 1);
    for (std::size_t i = 0; i < rows_.size(); ++i) {
      rows_[i] = nodes_.data() + i * width;
      fill(inputs.row(static_cast<Eigen::Index>(i)), rows_[i]);
    }
  }
  static void fill(const Eigen::RowVectorXd& input, svm_node* nodes) {
    for (Eigen::Index d = 0; d < input.size(); ++d) {
      nodes[d] = {static_cast<int>(d) + 1, input[d]};
    }
    nodes[input.size()] = {-1, 0.0};
  }
  [[nodiscard]] svm_problem view() {
    return {static_cast<int>(rows_.size()), targets_.data(), rows_.data()};
  }

 private:
  std::vector<svm_node> nodes_;
  std::vector<svm_node*> rows_;
  std::vector<double> targets_;
};

struct Machine {
  std::shared_ptr<Problem> problem;  // the model points into it
  std::shared_ptr<svm_model> model;

  [[nodiscard]] Eigen::VectorXd predict(const Eigen::MatrixXd& inputs) const {
    std::vector<svm_node> nodes(static_cast<std::size_t>(inputs.cols() + 1));
    Eigen::VectorXd out(inputs.rows());
    for (Eigen::Index i = 0; i < inputs.rows(); ++i) {
      Problem::fill(inputs.row(i), nodes.data());
      out[i] = svm_predict(model.get(), nodes.data());
    }
    return out;
  }
};

struct Setting {
  double penalty = 1.0;
  double gamma = 1.0;
  double tube = 0.01;
};

Machine train(const Eigen::MatrixXd& inputs, const Eigen::VectorXd& targets,
              const Setting& setting) {
  svm_set_print_string_function([](const char*) {});
  Machine machine;
  machine.problem = std::make_shared<Problem>(inputs, targets);
  svm_parameter parameter{};
  parameter.svm_type = EPSILON_SVR;
  parameter.kernel_type = RBF;
  parameter.gamma = setting.gamma;
  parameter.cache_size = kCacheMegabytes;
  parameter.eps = 1e-3;
  parameter.C = setting.penalty;
  parameter.p = setting.tube;
  parameter.shrinking = 1;
  svm_problem problem = machine.problem->view();
  machine.model = {svm_train(&problem, &parameter),
                   [](svm_model* model) { svm_free_and_destroy_model(&model); }};
  return machine;
}

// Mean squared error over motions that were left out: trajectories, or blocks with a gap to what
// was learned from.
double error_left_out(const Eigen::MatrixXd& inputs, const Eigen::VectorXd& targets,
                      const Folds& folds, const Setting& setting) {
  double sum = 0.0;
  for (const Fold& fold : folds.folds) {
    const Machine machine = train(inputs(fold.train, Eigen::all), targets(fold.train), setting);
    sum += (machine.predict(inputs(fold.test, Eigen::all)) - targets(fold.test)).squaredNorm();
  }
  return sum / static_cast<double>(inputs.rows());
}

// The same of the mean of what was learned from.
double constant_left_out(const Eigen::VectorXd& targets, const Folds& folds) {
  double sum = 0.0;
  for (const Fold& fold : folds.folds) {
    const double mean = targets(fold.train).mean();
    sum += (targets(fold.test).array() - mean).square().sum();
  }
  return sum / static_cast<double>(targets.size());
}

struct Choice {
  Setting setting;
  double error = std::numeric_limits<double>::infinity();
};

Choice choose(const Eigen::MatrixXd& inputs, const Eigen::VectorXd& targets, const Folds& folds) {
  Choice best;
  const double dimension = static_cast<double>(inputs.cols());
  for (const double penalty : {1.0, 10.0, 100.0}) {
    for (const double width : {0.1, 0.3, 1.0, 3.0}) {
      for (const double tube : {0.003, 0.03}) {
        const Setting setting{penalty, width / dimension, tube};
        const double error = error_left_out(inputs, targets, folds, setting);
        if (error < best.error) best = {setting, error};
      }
    }
  }
  return best;
}

}  // namespace

FittedTorqueModel fit_support_vectors(const TorqueSamples& samples) {
  if (samples.size() < 4 * kSearchFolds) {
    throw undetermined("support vectors", "too few samples", "record longer");
  }
  const Standardised data(samples);
  const auto few = evenly_chosen(samples.size(), kSearchSamples);
  const Folds folds = split_folds(select_rows(samples, few), {.folds = kSearchFolds});
  const Eigen::MatrixXd inputs = data.inputs(samples.q, samples.dq, samples.ddq);
  const Eigen::MatrixXd targets = data.targets(samples.torque);
  std::vector<Machine> machines;
  Eigen::RowVectorXd sigma(samples.joints());
  FittedTorqueModel out{TorqueModelKind::kSupportVectors, static_cast<int>(samples.size()), {}};
  out.left_out_nmse_percent.resize(samples.joints());
  for (Eigen::Index j = 0; j < samples.joints(); ++j) {
    const Eigen::VectorXd own = targets(few, j);
    const Choice choice = choose(inputs(few, Eigen::all), own, folds);
    machines.push_back(train(inputs, targets.col(j), choice.setting));
    const double constant = constant_left_out(own, folds);
    if (choice.error > constant) out.constant_joints.push_back(static_cast<int>(j));
    const double error = std::min(choice.error, constant);
    sigma[j] = std::sqrt(error) * data.torque_scale()[j];
    // Of the best of all settings: a little too good.
    out.left_out_nmse_percent[j] = 100.0 * error / (own.array() - own.mean()).square().mean();
  }
  out.predict = [data, machines, sigma, constant = out.constant_joints](
                    const Eigen::MatrixXd& q, const Eigen::MatrixXd& dq,
                    const Eigen::MatrixXd& ddq) {
    const Eigen::MatrixXd x = data.inputs(q, dq, ddq);
    Eigen::MatrixXd y(q.rows(), q.cols());
    for (Eigen::Index j = 0; j < y.cols(); ++j) {
      y.col(j) = machines[static_cast<std::size_t>(j)].predict(x);
    }
    for (const int joint : constant) y.col(joint).setZero();  // the mean, standardised
    return with_constant_sigma(data.torques(y), sigma);
  };
  return out;
}

}  // namespace kinescope::models
