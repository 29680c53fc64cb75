// SPDX-License-Identifier: Apache-2.0
#include "kinematics/structure/readings.h"

#include <algorithm>
#include <cmath>
#include <numeric>

namespace kinescope::structure_search {
namespace {

// A channel whose readings spread by less than this part of their size stands still.
constexpr double kStill = 1e-9;

Eigen::MatrixXd ordered(const Eigen::MatrixXd& values, const std::vector<int>& order) {
  Eigen::MatrixXd out(values.rows(), values.cols());
  for (std::size_t c = 0; c < order.size(); ++c)
    out.col(static_cast<Eigen::Index>(c)) = values.col(order[c]);
  return out;
}

Readings raw_readings(const JointLog& log, const Series& series, double offset_s,
                      double max_gap_s) {
  Readings r;
  r.log_channel = channel_order(log);
  const auto n = static_cast<Eigen::Index>(series.size());
  if (log.channels.empty()) {
    r.value = r.rate = Eigen::MatrixXd::Zero(n, 0);
    r.valid.assign(series.times_s.size(), 1);
    return r;
  }
  r.value = ordered(resample(log, series.times_s, offset_s, max_gap_s), r.log_channel);
  r.rate = ordered(resample_rates(log, series.times_s, offset_s, max_gap_s), r.log_channel);
  for (Eigen::Index i = 0; i < n; ++i) {
    const bool valid = r.value.row(i).allFinite() && r.rate.row(i).allFinite();
    r.valid.push_back(valid ? 1 : 0);
    if (valid) continue;
    r.value.row(i).setZero();
    r.rate.row(i).setZero();
  }
  return r;
}

void normalise(Readings& r) {
  for (std::size_t c = 0; c < r.mean.size(); ++c) {
    const auto col = static_cast<Eigen::Index>(c);
    const double scale = r.rms[c] > 0.0 ? 1.0 / r.rms[c] : 0.0;
    for (Eigen::Index i = 0; i < r.value.rows(); ++i) {
      const double on = r.valid[static_cast<std::size_t>(i)] != 0 ? scale : 0.0;
      r.value(i, col) = (r.value(i, col) - r.mean[c]) * on;
      r.rate(i, col) *= on;
    }
  }
}

}  // namespace

std::vector<int> channel_order(const JointLog& log) {
  std::vector<int> order(log.channels.size());
  std::iota(order.begin(), order.end(), 0);
  std::ranges::sort(order, {}, [&](int c) { return log.channels[static_cast<std::size_t>(c)]; });
  return order;
}

Readings readings_at(const JointLog& log, const Series& series, double time_offset_s,
                     double max_gap_s) {
  Readings r = raw_readings(log, series, time_offset_s, max_gap_s);
  const double count = std::max<double>(1.0, static_cast<double>(std::ranges::count(r.valid, 1)));
  for (Eigen::Index c = 0; c < r.value.cols(); ++c) {
    const double mean = r.value.col(c).sum() / count;
    double sum = 0.0;
    for (Eigen::Index i = 0; i < r.value.rows(); ++i) {
      if (r.valid[static_cast<std::size_t>(i)] != 0) sum += std::pow(r.value(i, c) - mean, 2);
    }
    const double rms = std::sqrt(sum / count);
    r.mean.push_back(mean);
    r.rms.push_back(rms > kStill * std::max(1e-3, std::abs(mean)) ? rms : 0.0);
  }
  normalise(r);
  return r;
}

std::vector<ChannelUnit> units_of(const JointLog& log,
                                  const std::map<std::string, ChannelUnit>& declared) {
  std::vector<ChannelUnit> units;
  for (const int c : channel_order(log)) {
    const auto unit = declared.find(log.channels[static_cast<std::size_t>(c)]);
    units.push_back(unit == declared.end() ? ChannelUnit::kUnknown : unit->second);
  }
  return units;
}

double channel_correlation(const Readings& readings, int a, int b) {
  const double size = readings.value.col(a).norm() * readings.value.col(b).norm();
  return size > 0.0 ? readings.value.col(a).dot(readings.value.col(b)) / size : 0.0;
}

Readings readings_like(const Readings& other, const JointLog& log, const Series& series,
                       double time_offset_s, double max_gap_s) {
  Readings r = raw_readings(log, series, time_offset_s, max_gap_s);
  r.mean = other.mean;
  r.rms = other.rms;
  r.units = other.units;
  r.si_share = other.si_share;
  normalise(r);
  return r;
}

}  // namespace kinescope::structure_search
