// SPDX-License-Identifier: Apache-2.0
#include "dynamics/contact/onset_bank.h"

#include <algorithm>
#include <bit>
#include <cmath>

#include "kinematics/core/chi_square.h"

namespace kinescope::contact {
namespace {

/// A standard normal variable passes it with probability 1e-7.
constexpr double kRare = 5.2;
/// Onsets kept an octave are 2^this; the ratio of a growing torque is smoother in its onset.
constexpr int kPerOctave = 2;
constexpr int kGrowingPerOctave = 1;

int octave_of(int age) { return static_cast<int>(std::bit_width(static_cast<unsigned>(age))) - 1; }

}  // namespace

OnsetBank::OnsetBank(Eigen::Index joints, int longest_age)
    : n_(joints), longest_age_(std::max(1, longest_age)) {
  const int octaves = octave_of(longest_age_) + 1;
  const Eigen::Index slots =
      Eigen::Index{octaves + 2} * ((1 << kPerOctave) + (1 << kGrowingPerOctave));
  candidates_.resize(static_cast<std::size_t>(slots));
  for (Eigen::MatrixXd* m : {&error_p_, &error_d_, &information_, &white_}) {
    *m = Eigen::MatrixXd::Zero(n_, n_ * slots);
  }
  score_ = Eigen::MatrixXd::Zero(n_, slots);
  factor_ = Eigen::MatrixXd::Zero(n_, n_);
  c_ = Eigen::VectorXd::Zero(n_);
  bonus_.resize(n_);
  const auto n = static_cast<int>(n_);
  for (int k = 1; k <= n; ++k) {
    bonus_[k - 1] = chi_square_quantile(n, kRare) - chi_square_quantile(k, kRare);
  }
  best_.resize(static_cast<std::size_t>(octaves));
}

void OnsetBank::clear() {
  used_ = 0;
  std::ranges::fill(best_, OctaveBest{});
}

/// Drops candidates that are too old, or too close to their neighbours for their age.
void OnsetBank::age_candidates() {
  ++now_;
  for (Eigen::Index s = 0; s < used_;) {
    Candidate& candidate = candidates_[static_cast<std::size_t>(s)];
    candidate.age = static_cast<int>(now_ - candidate.onset + 1);
    const int per_octave = candidate.grows ? kGrowingPerOctave : kPerOctave;
    const int spacing = 1 << std::max(0, octave_of(candidate.age) - per_octave);
    if (candidate.age <= longest_age_ && candidate.onset % spacing == 0) {
      ++s;
      continue;
    }
    --used_;
    candidate = candidates_[static_cast<std::size_t>(used_)];
    for (Eigen::MatrixXd* m : {&error_p_, &error_d_, &information_}) {
      m->middleCols(s * n_, n_) = m->middleCols(used_ * n_, n_);
    }
    score_.col(s) = score_.col(used_);
  }
}

void OnsetBank::add_candidate(bool grows) {
  candidates_[static_cast<std::size_t>(used_)] = {.onset = now_, .grows = grows, .age = 1};
  for (Eigen::MatrixXd* m : {&error_p_, &error_d_, &information_}) {
    m->middleCols(used_ * n_, n_).setZero();
  }
  score_.col(used_).setZero();
  ++used_;
}

void OnsetBank::advance(const BalanceFilter& filter) {
  age_candidates();
  const double dt = filter.step_s();
  const Eigen::Index old = used_ * n_;
  error_p_.leftCols(old) += dt * error_d_.leftCols(old);
  for (Eigen::Index j = 0; j < n_; ++j) error_d_.row(j).head(old) *= filter.decay()[j];
  add_candidate(false);
  add_candidate(true);
  // The unit of a growing torque is free: one of a step's mean, times its number.
  for (Eigen::Index s = 0; s < used_; ++s) {
    const Candidate& candidate = candidates_[static_cast<std::size_t>(s)];
    const double torque = candidate.grows ? candidate.age - 0.5 : 1.0;
    error_p_.middleCols(s * n_, n_).diagonal().array() += dt * torque;
  }

  const Eigen::Index all = used_ * n_;
  white_.leftCols(all).noalias() = filter.whitener() * error_p_.leftCols(all);
  error_p_.leftCols(all).noalias() -= filter.gain_p().transpose() * white_.leftCols(all);
  error_d_.leftCols(all).noalias() -= filter.gain_d().transpose() * white_.leftCols(all);
  std::ranges::fill(best_, OctaveBest{});
  for (Eigen::Index s = 0; s < used_; ++s) {
    const int age = candidates_[static_cast<std::size_t>(s)].age;
    const double statistic = evaluate(s, filter.innovation());
    OctaveBest& best = best_[static_cast<std::size_t>(octave_of(age))];
    if (statistic > best.statistic) best = {.statistic = statistic, .age = age};
  }
}

/// With information = L L', c = L^-1 score: the ratio for links up to k is c_1^2 + .. + c_k^2.
double OnsetBank::evaluate(Eigen::Index slot, const Eigen::VectorXd& innovation) {
  const auto white = white_.middleCols(slot * n_, n_);
  auto information = information_.middleCols(slot * n_, n_);
  auto score = score_.col(slot);
  information.noalias() += white.transpose().lazyProduct(white);
  score.noalias() += white.transpose().lazyProduct(innovation);
  double sum = 0.0;
  double best = 0.0;
  for (Eigen::Index c = 0; c < n_; ++c) {
    double value = score[c];
    for (Eigen::Index k = 0; k < c; ++k) {
      double entry = information(c, k);
      for (Eigen::Index m = 0; m < k; ++m) entry -= factor_(c, m) * factor_(k, m);
      factor_(c, k) = entry / factor_(k, k);
      value -= factor_(c, k) * c_[k];
    }
    double pivot = information(c, c);
    for (Eigen::Index m = 0; m < c; ++m) pivot -= factor_(c, m) * factor_(c, m);
    // A torque that the data since the onset cannot tell from the others'.
    if (!(pivot > 1e-12 * information(c, c))) return best;
    factor_(c, c) = std::sqrt(pivot);
    value /= factor_(c, c);
    c_[c] = value;
    sum += value * value;
    best = std::max(best, sum + bonus_[c]);
  }
  return best;
}

}  // namespace kinescope::contact
