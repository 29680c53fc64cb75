// SPDX-License-Identifier: Apache-2.0
#include "dynamics/gp/lip_kernel.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include <fmt/format.h>

#include "dynamics/gp/kernel_node.h"
#include "dynamics/gp/lip_features.h"
#include "dynamics/gp/lip_pairs.h"
#include "kinematics/core/error.h"

namespace kinescope::gp {
namespace {

using Eigen::Index;
using lip_pairs::kLanes;
using lip_pairs::Lane;

double sum(const Lane& lane) {
  double out = 0.0;
  for (const double value : lane.v) out += value;
  return out;
}

// Tables of prepared inputs: cos q (or q), sin q, dq, ddq; samples x joints.
enum Table : std::size_t { kCosine, kSine, kVelocity, kAcceleration, kTables };

class LipNode : public KernelNode {
 public:
  explicit LipNode(JointKinds joints) : joints_(std::move(joints)), layout_(joints_) {}

  [[nodiscard]] int outputs() const override { return n(); }
  [[nodiscard]] int input_columns() const override { return 3 * n(); }
  [[nodiscard]] Index parameter_count() const override { return layout_.count; }

  void featurise(const Inputs& inputs, Prepared& out) const override {
    out.samples = inputs.rows();
    out.tables.resize(kTables);
    for (Eigen::MatrixXd& table : out.tables) table.resize(inputs.rows(), n());
    for (int j = 0; j < n(); ++j) {
      const auto q = inputs.col(j).array();
      if (joints_[static_cast<std::size_t>(j)] == JointKind::kRevolute) {
        out.tables[kCosine].col(j) = q.cos();
        out.tables[kSine].col(j) = q.sin();
      } else {
        out.tables[kCosine].col(j) = q;
        out.tables[kSine].col(j).setZero();
      }
    }
    out.tables[kVelocity] = inputs.middleCols(size(), size());
    out.tables[kAcceleration] = inputs.middleCols(2 * size(), size());
  }
  void rescale(const Theta&, Prepared&) const override {}  // weights are read pair by pair

  void evaluate(const Theta& theta, Samples a, Samples b, Scratch&, Block out) const override {
    const Energies energies = read(theta);
    lip_pairs::Torques k;
    for (Index i = 0; i < a.size; i += kLanes) {
      const lip_pairs::Strip strip = strip_of(a, i);
      const Index lanes = std::min<Index>(kLanes, a.size - i);
      for (Index j = 0; j < b.size; ++j) {
        const lip_pairs::Sample sample = sample_of(b, j);
        clear(k);
        for (int link = 0; link < n(); ++link) {
          lip_pairs::add_kinetic(joints_, link, energies.links[static_cast<std::size_t>(link)],
                                 strip, sample, k);
        }
        lip_pairs::add_potential(joints_, energies.potential, energies.scale, strip, sample, k);
        for (int p = 0; p < n(); ++p) {
          for (int q = 0; q < n(); ++q) {
            const Lane& lane = k[static_cast<std::size_t>(p)][static_cast<std::size_t>(q)];
            for (Index l = 0; l < lanes; ++l) {
              out(p * a.size + i + l, q * b.size + j) = lane.v[l];
            }
          }
        }
      }
    }
  }

  void contract(const Theta& theta, Samples a, Samples b, const ConstBlock& weights, Scratch&,
                Gradient gradient) const override {
    const Energies energies = read(theta);
    std::vector<lip_pairs::WeightGradient> links(joints_.size(), lip_pairs::WeightGradient{});
    lip_pairs::WeightGradient potential{};
    Lane by_scale{};
    lip_pairs::Torques q;
    clear(q);
    for (Index i = 0; i < a.size; i += kLanes) {
      const lip_pairs::Strip strip = strip_of(a, i);
      const Index lanes = std::min<Index>(kLanes, a.size - i);
      for (Index j = 0; j < b.size; ++j) {
        const lip_pairs::Sample sample = sample_of(b, j);
        // Lanes past the end have no weight.
        for (int r = 0; r < n(); ++r) {
          for (int c = 0; c < n(); ++c) {
            Lane& lane = q[static_cast<std::size_t>(r)][static_cast<std::size_t>(c)];
            for (Index l = 0; l < kLanes; ++l) {
              lane.v[l] = l < lanes ? weights(r * a.size + i + l, c * b.size + j) : 0.0;
            }
          }
        }
        for (int link = 0; link < n(); ++link) {
          const auto at = static_cast<std::size_t>(link);
          lip_pairs::contract_kinetic(joints_, link, energies.links[at], strip, sample, q,
                                      links[at]);
        }
        lip_pairs::contract_potential(joints_, energies.potential, energies.scale, strip, sample, q,
                                      potential, by_scale);
      }
    }
    write(energies, links, potential, by_scale, gradient);
  }

  [[nodiscard]] std::optional<double> feature_count() const override {
    return lip_feature_count(joints_);
  }
  [[nodiscard]] Basis basis(const Inputs& inputs) const override {
    return lip_features(joints_, layout_, inputs);
  }

 private:
  struct Energies {
    std::vector<lip_pairs::Weights> links;
    lip_pairs::Weights potential{};
    double scale = 0.0;
  };

  [[nodiscard]] int n() const { return static_cast<int>(joints_.size()); }
  [[nodiscard]] Index size() const { return static_cast<Index>(joints_.size()); }

  void clear(lip_pairs::Torques& torques) const {
    for (std::size_t r = 0; r < joints_.size(); ++r) {
      for (std::size_t c = 0; c < joints_.size(); ++c) torques[r][c] = Lane{};
    }
  }

  [[nodiscard]] lip_pairs::Strip strip_of(Samples a, Index first) const {
    lip_pairs::Strip out;
    for (Index l = 0; l < kLanes; ++l) {
      const Index row = a.begin + std::min(first + l, a.size - 1);
      for (int j = 0; j < n(); ++j) {
        const auto at = static_cast<std::size_t>(j);
        out.cosine[at].v[l] = a.of.tables[kCosine](row, j);
        out.sine[at].v[l] = a.of.tables[kSine](row, j);
        out.velocity[at].v[l] = a.of.tables[kVelocity](row, j);
        out.acceleration[at].v[l] = a.of.tables[kAcceleration](row, j);
      }
    }
    return out;
  }

  [[nodiscard]] lip_pairs::Sample sample_of(Samples b, Index index) const {
    lip_pairs::Sample out;
    const Index row = b.begin + index;
    for (int j = 0; j < n(); ++j) {
      const auto at = static_cast<std::size_t>(j);
      out.cosine[at] = b.of.tables[kCosine](row, j);
      out.sine[at] = b.of.tables[kSine](row, j);
      out.velocity[at] = b.of.tables[kVelocity](row, j);
      out.acceleration[at] = b.of.tables[kAcceleration](row, j);
    }
    return out;
  }

  void read_positions(const Theta& theta, const std::vector<LipLayout::Position>& positions,
                      lip_pairs::Weights& out) const {
    for (std::size_t j = 0; j < positions.size(); ++j) {
      out.cosine[j] = std::exp(theta[positions[j].cosine]);
      out.sine[j] = positions[j].sine < 0 ? 0.0 : std::exp(theta[positions[j].sine]);
    }
  }

  [[nodiscard]] Energies read(const Theta& theta) const {
    Energies out;
    for (const LipLayout::Link& link : layout_.links) {
      lip_pairs::Weights weights{};
      for (std::size_t j = 0; j < link.velocity.size(); ++j) {
        weights.velocity[j] = std::exp(theta[link.velocity[j]]);
      }
      read_positions(theta, link.positions, weights);
      out.links.push_back(weights);
    }
    read_positions(theta, layout_.potential, out.potential);
    out.scale = std::exp(theta[layout_.scale]);
    return out;
  }

  static void write_positions(const lip_pairs::Weights& weights,
                              const std::vector<LipLayout::Position>& positions,
                              const lip_pairs::WeightGradient& by, Gradient gradient) {
    for (std::size_t j = 0; j < positions.size(); ++j) {
      gradient[positions[j].cosine] += weights.cosine[j] * sum(by.cosine[j]);
      if (positions[j].sine >= 0) {
        gradient[positions[j].sine] += weights.sine[j] * sum(by.sine[j]);
      }
    }
  }

  // d/dlog w = w d/dw.
  void write(const Energies& energies, const std::vector<lip_pairs::WeightGradient>& links,
             const lip_pairs::WeightGradient& potential, const Lane& by_scale,
             Gradient gradient) const {
    for (std::size_t i = 0; i < links.size(); ++i) {
      const LipLayout::Link& link = layout_.links[i];
      for (std::size_t j = 0; j < link.velocity.size(); ++j) {
        gradient[link.velocity[j]] += energies.links[i].velocity[j] * sum(links[i].velocity[j]);
      }
      write_positions(energies.links[i], link.positions, links[i], gradient);
    }
    write_positions(energies.potential, layout_.potential, potential, gradient);
    gradient[layout_.scale] += energies.scale * sum(by_scale);
  }

  JointKinds joints_;
  LipLayout layout_;
};

void describe_positions(const std::vector<LipLayout::Position>& positions, const std::string& name,
                        std::vector<Parameter>& out) {
  for (std::size_t j = 0; j < positions.size(); ++j) {
    const bool turns = positions[j].sine >= 0;
    const auto put = [&](Index at, const char* what) {
      out[static_cast<std::size_t>(at)] = {.name = fmt::format("{} {} q{}", name, what, j),
                                           .value = 0.3,
                                           .lower = 1e-8,
                                           .upper = 1e4};
    };
    put(positions[j].cosine, turns ? "cos" : "position");
    if (turns) put(positions[j].sine, "sin");
  }
}

}  // namespace

Kernel lip(const JointKinds& joints) {
  KINESCOPE_CHECK(!joints.empty() && joints.size() <= kLipMaxJoints, "1 to 10 joints");
  const LipLayout layout(joints);
  std::vector<Parameter> parameters(static_cast<std::size_t>(layout.count));
  for (std::size_t i = 0; i < layout.links.size(); ++i) {
    const std::string name = fmt::format("kinetic {}", i);
    const LipLayout::Link& link = layout.links[i];
    for (std::size_t j = 0; j < link.velocity.size(); ++j) {
      parameters[static_cast<std::size_t>(link.velocity[j])] = {
          .name = fmt::format("{} weight dq{}", name, j),
          .value = 0.1,
          .lower = 1e-8,
          .upper = 1e4};
    }
    describe_positions(link.positions, name, parameters);
  }
  parameters[static_cast<std::size_t>(layout.scale)] = {
      .name = "potential scale", .value = 10.0, .lower = 1e-8, .upper = 1e8};
  describe_positions(layout.potential, "potential", parameters);
  return {std::make_shared<LipNode>(joints), std::move(parameters)};
}

}  // namespace kinescope::gp
