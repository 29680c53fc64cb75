// SPDX-License-Identifier: Apache-2.0
#include "kinematics/structure/find_attachments.h"

#include <algorithm>
#include <limits>

#include "kinematics/structure/attachment_path.h"
#include "kinematics/structure/chain_kinematics.h"
#include "kinematics/structure/coupling.h"
#include "kinematics/structure/follow_channel.h"
#include "kinematics/structure/screening.h"
#include "kinematics/structure/tangent.h"

namespace kinescope::structure_search {
namespace {

// Candidates this much worse (-2 ln likelihood, linear) than the best refined one are not refined.
constexpr double kHopeless = 60.0;
// The same for candidates that leave more than this across the joint (variance over the declared
// one), and more than this part of the motion: is_acceptable() asks for far less of either.
constexpr double kHopelessVariance = 50.0;
constexpr double kHopelessShare = 0.01;
constexpr std::size_t kFewestTogether = 5;

// Fits with the weight along the joint that its inexactness asks for.
ChainFit fit_weighted(const Motion& motion, const Readings& readings, const ChainModel& start,
                      bool with_residuals) {
  ChainFit fit = fit_chain(motion, readings.value, start, {.with_residuals = with_residuals});
  if (fit.axis_variance > 2.0 * kInexact) {
    ChainFit again =
        fit_chain(motion, readings.value, fit.model,
                  {.axis_weight = 1.0 / fit.axis_variance, .with_residuals = with_residuals});
    if (again.cost < fit.cost) fit = std::move(again);
  }
  return fit;
}

// Refines candidates of one body and one link, and keeps them.
class Refiner {
 public:
  Refiner(const Body& body, int parent, const RelativeMotion& relative, const Readings& readings,
          const std::vector<char>& usable)
      : body_(body), relative_(relative), readings_(readings), usable_(usable), parent_(parent) {}

  void refine(const Candidate& candidate) {
    ChainFit fit = fit_weighted(relative_.motion, readings_, candidate.start, true);
    if (candidate.channel >= 0) {
      fit = with_couplings(std::move(fit), relative_.motion, readings_, usable_);
    } else if (!candidate.start.joints.empty()) {
      const auto driven = driven_by_best_channel(fit.model, relative_.motion, readings_, usable_);
      if (driven) refine(*driven);
    }
    fit.residuals = {};
    out_.push_back(attachment_from(std::move(fit), parent_, relative_, body_, readings_));
    best_ = std::min(best_, out_.back().data_cost);
  }

  [[nodiscard]] double best() const { return best_; }
  [[nodiscard]] std::size_t count() const { return out_.size(); }

  [[nodiscard]] std::vector<Attachment> sorted() && {
    if (out_.empty()) return {};
    const auto by_data = std::ranges::min_element(out_, {}, &Attachment::data_cost);
    const double correlation = by_data->fit.correlation;
    std::ranges::stable_sort(out_, {}, [&](const Attachment& a) { return a.cost(correlation); });
    return std::move(out_);
  }

 private:
  const Body& body_;
  const RelativeMotion& relative_;
  const Readings& readings_;
  const std::vector<char>& usable_;
  int parent_ = 0;
  double best_ = std::numeric_limits<double>::infinity();
  std::vector<Attachment> out_;
};

// The coordinates of a single joint without channels that put the child closest to each sighting,
// each started from the one before.
std::vector<double> coordinates_from(const Motion& motion, const ChainModel& model) {
  std::vector<double> coordinates(motion.size(), 0.0);
  const ChainKinematics chain(model);
  double value = 0.0;
  for (std::size_t i = 0; i < motion.size(); ++i) {
    const Matrix6d& W = motion[i].whitening;
    const Vector6d u = W * chain.last_axis();
    for (int pass = 0; pass < 6; ++pass) {
      const Vector6d r = W * fast_log(chain.left_over(&value, motion[i].pose));
      value += u.dot(r) / u.squaredNorm();
    }
    coordinates[i] = value;
  }
  return coordinates;
}

}  // namespace

std::vector<Attachment> find_attachments(const Body& body, int parent, const LinkPath& path,
                                         const Readings& readings, const std::vector<char>& usable,
                                         const AttachmentOptions& options) {
  const RelativeMotion relative = relative_motion(body, path, readings);
  const auto seen = static_cast<std::size_t>(seen_with_log(body, readings));
  if (relative.motion.size() < kFewestTogether || 3 * relative.motion.size() < seen) return {};
  const std::vector<Candidate> candidates =
      screen_motion(relative.motion, readings.value, usable,
                    {.coordinate_free = options.coordinate_free, .max_channels = 4});
  const double limit = options.give_up_above * static_cast<double>(relative.motion.size());
  Refiner refiner(body, parent, relative, readings, usable);
  for (const Candidate& candidate : candidates) {
    const bool rest = candidate.start.joints.empty();
    const bool enough = static_cast<int>(refiner.count()) >= options.max_refined && !rest;
    const double hopeless = (rest ? 1.5 * refiner.best() : refiner.best()) + kHopeless;
    if (refiner.count() > 0 && (candidate.cost > hopeless || enough)) continue;
    if (candidate.across > kHopelessVariance && candidate.share > kHopelessShare) continue;
    if (candidate.cost > limit + kHopeless) continue;
    refiner.refine(candidate);
  }
  return std::move(refiner).sorted();
}

Attachment refit(const Attachment& attachment, const Body& body, const LinkPath& path,
                 const Readings& readings) {
  const RelativeMotion relative = relative_motion(body, path, readings);
  ChainModel start = attachment.fit.model;
  if (!attachment.at_rest() && !attachment.driven()) {
    // Free coordinates belong to samples: take them anew from the sightings.
    start.coordinates = coordinates_from(relative.motion, start);
  }
  ChainFit fit = fit_weighted(relative.motion, readings, start, false);
  Attachment a = attachment_from(std::move(fit), attachment.parent, relative, body, readings);
  a.order_doubts = attachment.order_doubts;
  return a;
}

}  // namespace kinescope::structure_search
