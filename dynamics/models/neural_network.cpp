// SPDX-License-Identifier: Apache-2.0
#include "dynamics/models/neural_network.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <vector>

#include <dlib/dnn.h>
#include <fmt/format.h>

#include "dynamics/data/splits.h"
#include "dynamics/models/standardised.h"
#include "kinematics/core/error.h"
#include "kinematics/core/rng.h"
#include "kinematics/core/single_threaded_blas.h"

namespace kinescope::models {
namespace {

using Eigen::Index;

constexpr long kSigmoids = 400;
// Outermost first, as dlib writes it; the number of outputs is set when it is known.
using Net = dlib::loss_mean_squared_multioutput<
    dlib::fc<1, dlib::sig<dlib::fc<
                    kSigmoids, dlib::sig<dlib::fc<kSigmoids, dlib::input<dlib::matrix<float>>>>>>>>;
using Vectors = std::vector<dlib::matrix<float>>;

Vectors rows_of(const Eigen::MatrixXd& values) {
  Vectors out(static_cast<std::size_t>(values.rows()));
  for (Index i = 0; i < values.rows(); ++i) {
    dlib::matrix<float>& row = out[static_cast<std::size_t>(i)];
    row.set_size(values.cols(), 1);
    for (Index d = 0; d < values.cols(); ++d) row(d) = static_cast<float>(values(i, d));
  }
  return out;
}

Eigen::MatrixXd outputs(Net& net, const Vectors& inputs, Index columns) {
  constexpr std::size_t kChunk = 1024;
  Eigen::MatrixXd out(static_cast<Index>(inputs.size()), columns);
  dlib::resizable_tensor batch;
  for (std::size_t begin = 0; begin < inputs.size(); begin += kChunk) {
    const std::size_t end = std::min(inputs.size(), begin + kChunk);
    const auto at = [&](std::size_t i) { return inputs.begin() + static_cast<std::ptrdiff_t>(i); };
    net.to_tensor(at(begin), at(end), batch);
    const float* value = net.subnet().forward(batch).host();
    for (std::size_t i = begin; i < end; ++i) {
      for (Index d = 0; d < columns; ++d) out(static_cast<Index>(i), d) = *value++;
    }
  }
  return out;
}

// Glorot and Bengio 2010, eq. 16, twice as wide: a sigmoid's slope is a quarter, not one. Biases
// start at zero. dlib's own draw would take the C library's global generator.
template <typename Layer>
void draw_weights(Layer& layer, Index inputs, Index width, Rng& rng) {
  float* weight = layer.layer_details().get_layer_params().host_write_only();
  const double bound = 2.0 * std::sqrt(6.0 / static_cast<double>(inputs + width));
  for (Index k = 0; k < inputs * width; ++k) {
    *weight++ = static_cast<float>(rng.uniform(-bound, bound));
  }
  std::fill_n(weight, width, 0.0F);
}

Net fresh_network(const Vectors& inputs, Index columns, Rng& rng) {
  Net net;
  dlib::layer<1>(net).layer_details().set_num_outputs(columns);
  const Index width = inputs.front().size();
  (void)outputs(net, {inputs.front()}, columns);  // dlib makes the weights on first use
  draw_weights(dlib::layer<5>(net), width, kSigmoids, rng);
  draw_weights(dlib::layer<3>(net), kSigmoids, kSigmoids, rng);
  draw_weights(dlib::layer<1>(net), kSigmoids, columns, rng);
  return net;
}

void shuffle(std::vector<std::size_t>& order, Rng& rng) {
  for (std::size_t i = order.size(); i > 1; --i) {
    std::swap(order[i - 1], order[static_cast<std::size_t>(rng.index(static_cast<int>(i)))]);
  }
}

class Trainer {
 public:
  Trainer(Net net, const Vectors& inputs, const Vectors& targets, double weight_decay)
      : net_(std::move(net)),
        inputs_(inputs),
        targets_(targets),
        solvers_(Net::num_computational_layers,
                 dlib::adam(static_cast<float>(weight_decay), 0.9F, 0.999F)),
        order_(inputs.size()) {
    for (std::size_t i = 0; i < order_.size(); ++i) order_[i] = i;
  }

  void epoch(double rate, std::size_t batch, Rng& rng) {
    shuffle(order_, rng);
    for (std::size_t begin = 0; begin < order_.size(); begin += batch) {
      const std::size_t end = std::min(order_.size(), begin + batch);
      Vectors x, y;
      for (std::size_t i = begin; i < end; ++i) {
        x.push_back(inputs_[order_[i]]);
        y.push_back(targets_[order_[i]]);
      }
      net_.to_tensor(x.begin(), x.end(), tensor_);
      net_.compute_parameter_gradients(tensor_, y.begin());
      net_.update_parameters(solvers_, rate);
    }
  }
  [[nodiscard]] Net& net() { return net_; }

 private:
  Net net_;
  const Vectors& inputs_;
  const Vectors& targets_;
  std::vector<dlib::adam> solvers_;
  std::vector<std::size_t> order_;
  dlib::resizable_tensor tensor_;
};

struct TrainedNetwork {
  Net net;
  Eigen::RowVectorXd error;  ///< rms on what was held out, standardised
  int epochs = 0;
};

TrainedNetwork train(const Eigen::MatrixXd& inputs, const Eigen::MatrixXd& targets,
                     const Fold& fold, const NeuralNetworkOptions& options, Rng& rng) {
  const Vectors x = rows_of(inputs(fold.train, Eigen::all));
  const Vectors y = rows_of(targets(fold.train, Eigen::all));
  const Vectors unseen = rows_of(inputs(fold.test, Eigen::all));
  const Eigen::MatrixXd wanted = targets(fold.test, Eigen::all);
  Trainer trainer(fresh_network(x, targets.cols(), rng), x, y, options.weight_decay);
  TrainedNetwork best{trainer.net(), {}, 0};
  double least = std::numeric_limits<double>::infinity();
  double rate = options.learning_rate;
  int waited = 0;
  for (int e = 1; e <= options.epochs && rate > options.smallest_rate; ++e) {
    trainer.epoch(rate, static_cast<std::size_t>(options.batch), rng);
    const Eigen::MatrixXd error = wanted - outputs(trainer.net(), unseen, wanted.cols());
    if (error.squaredNorm() < least) {
      least = error.squaredNorm();
      best = {trainer.net(), error.colwise().norm() / std::sqrt(static_cast<double>(error.rows())),
              e};
      waited = 0;
    } else if (++waited == options.patience) {
      rate *= 0.5;
      waited = 0;
    }
  }
  if (best.epochs == 0) {
    throw undetermined("neural network", "the training diverged", "lower the rate of learning");
  }
  best.net.clean();
  return best;
}

void check(const TorqueSamples& samples, const NeuralNetworkOptions& options) {
  const bool sound = options.epochs > 0 && options.batch > 0 && options.patience > 0 &&
                     options.learning_rate > 0.0 && options.smallest_rate > 0.0 &&
                     options.weight_decay >= 0.0;
  if (!sound)
    throw bad_request("neural network", "an option out of range", "give positive numbers");
  for (const Eigen::MatrixXd* part : {&samples.q, &samples.dq, &samples.ddq, &samples.torque}) {
    if (part->allFinite()) continue;
    throw bad_request("neural network", "a sample that is not finite", "leave it out");
  }
}

}  // namespace

FittedTorqueModel fit_neural_network(const TorqueSamples& samples,
                                     const NeuralNetworkOptions& options, std::uint64_t seed) {
  check(samples, options);
  constexpr double kHeldOut = 0.2;
  const Fold fold = split_last(samples, kHeldOut);
  // OpenBLAS's threads change the last bits, and such small products only wait for each other.
  const SingleThreadedBlas guard;
  const Standardised data(samples);
  Rng rng = Rng::from_name("neural network", seed);
  const TrainedNetwork trained = train(data.inputs(samples.q, samples.dq, samples.ddq),
                                       data.targets(samples.torque), fold, options, rng);
  FittedTorqueModel out{TorqueModelKind::kNeuralNetwork, static_cast<int>(samples.size()), {}};
  Eigen::RowVectorXd error = trained.error;
  out.left_out_nmse_percent.resize(error.size());
  const Eigen::MatrixXd targets = data.targets(samples.torque);
  for (Eigen::Index j = 0; j < error.size(); ++j) {
    const Eigen::ArrayXd unseen = targets(fold.test, j).array();
    const double mean = targets(fold.train, j).mean();
    const double constant = std::sqrt((unseen - mean).square().mean());
    if (error[j] > constant) out.constant_joints.push_back(static_cast<int>(j));
    error[j] = std::min(error[j], constant);
    out.left_out_nmse_percent[j] =
        100.0 * error[j] * error[j] / (unseen - unseen.mean()).square().mean();
  }
  const Eigen::RowVectorXd sigma = error.cwiseProduct(data.torque_scale());
  out.predict =
      [data, net = std::make_shared<const Net>(trained.net), sigma, constant = out.constant_joints](
          const Eigen::MatrixXd& q, const Eigen::MatrixXd& dq, const Eigen::MatrixXd& ddq) {
        const SingleThreadedBlas one_thread;
        Net own = *net;  // a pass through the network changes it
        Eigen::MatrixXd y = outputs(own, rows_of(data.inputs(q, dq, ddq)), q.cols());
        for (const int joint : constant) y.col(joint).setZero();  // the mean, standardised
        return with_constant_sigma(data.torques(y), sigma);
      };
  return out;
}

}  // namespace kinescope::models
