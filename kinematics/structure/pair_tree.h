// SPDX-License-Identifier: Apache-2.0
//
// Takes   a series and readings.
// Gives   which bodies are likely neighbours, before any joint is fitted.
// Method  the logarithm of the relative pose of two neighbouring bodies is linear in one channel at
//         the right clock offset and at no other. Which bodies are neighbours is not known: every
//         pair is regressed on every channel, and the pairs that tell most are joined to a tree
//         (Chow and Liu 1968: the tree of pairs with the largest sum of mutual informations is the
//         most likely one). Pairs enter by the likelihood of one body's sightings given the
//         other's, so that a noisy partner explains nothing.
#pragma once

#include <vector>

#include "kinematics/structure/readings.h"

namespace kinescope::structure_search {

/// The relative motion of two bodies in a form linear in the channel that drives it: logarithms
/// about the mean pose or, where the turn is too wide for one, from each sample to the next.
struct BodyPair {
  int first = -1;  ///< body; -1: the camera
  int second = 0;
  Eigen::MatrixXd y;      ///< 6 x samples, whitened
  std::vector<int> from;  ///< instants; -1: from the mean
  std::vector<int> to;
  double free_cost = 0.0;  ///< -2 ln likelihood a sample, without any channel
};

/// All pairs that are seen together often enough, on at most about `most_instants` instants.
[[nodiscard]] std::vector<BodyPair> body_pairs(const Series& series, int most_instants);

struct PairEdge {
  int first = -1;  ///< body; -1: the camera
  int second = 0;
  double cost = 0.0;  ///< -2 ln likelihood a sample: 6 where nothing but noise is left
};

struct PairTree {
  std::vector<PairEdge> edges;
  double gain = 0.0;  ///< -2 ln likelihood ratio of free bodies against the tree
};

[[nodiscard]] PairTree pair_tree(const std::vector<BodyPair>& pairs, std::size_t bodies,
                                 const Readings& readings);

/// What each body costs with its neighbours in the tree, a sighting, with a margin: its parent is
/// among them. Infinite for bodies without any.
[[nodiscard]] std::vector<double> likely_costs(const PairTree& tree, std::size_t bodies);

}  // namespace kinescope::structure_search
