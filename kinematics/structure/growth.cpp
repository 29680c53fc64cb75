// SPDX-License-Identifier: Apache-2.0
#include "kinematics/structure/growth.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "kinematics/structure/series.h"
#include "kinematics/structure/several_joints.h"

namespace kinescope::structure_search {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();
// Added to the cost of a free body that is seen to rest.
constexpr double kNeverFree = 1e6;
// Rounds in which bodies may change places.
constexpr int kMostRounds = 4;

std::vector<char> moving_channels(const Readings& readings) {
  std::vector<char> usable;
  for (int c = 0; c < readings.channels(); ++c) usable.push_back(readings.moves(c) ? 1 : 0);
  return usable;
}

class Grower {
 public:
  Grower(const Series& series, const Readings& readings, const GrowthOptions& options)
      : series_(series),
        readings_(readings),
        options_(options),
        usable_(moving_channels(readings)),
        moves_freely_(series.bodies.size(), 0) {
    tree_.bodies.resize(series.bodies.size());
    for (std::size_t b = 0; b < series.bodies.size(); ++b) {
      const FreeCost free = free_cost(series.bodies[b], readings);
      tree_.bodies[b].free_cost = free.as_seen;
      tree_.bodies[b].everywhere_cost = std::max(free.as_seen, free.everywhere);
    }
    GrownLink camera;
    camera.path = camera_path(series.size());
    add_link(std::move(camera));
  }

  GrownTree run() {
    do {
      while (attach_next()) {
      }
    } while (options_.paths_of_several_joints && attach_through_unseen_links());
    for (int round = 0; round < kMostRounds && rearrange(); ++round) {
    }
    while (give_up_contradicted_joint()) {
    }
    return std::move(tree_);
  }

 private:
  const Body& body(std::size_t b) const { return series_.bodies[b]; }

  void add_link(GrownLink link) {
    tree_.links.push_back(std::move(link));
    const int index = static_cast<int>(tree_.links.size()) - 1;
    for (std::size_t b = 0; b < tree_.bodies.size(); ++b) look_at(b, index);
  }

  // Lists the ways in which body b may hang on a link.
  void look_at(std::size_t b, int link) {
    GrownBody& g = tree_.bodies[b];
    if (tree_.links[static_cast<std::size_t>(link)].founder == static_cast<int>(b)) return;
    if (g.link >= 0 && is_below(link, static_cast<int>(b))) return;
    const Attachment* best = best_of(g);
    AttachmentOptions options;
    if (best != nullptr && body(b).seen > 0) {
      options.give_up_above = std::max(0.0, best->data_cost / body(b).seen) + 3.0;
    }
    auto found = find_attachments(body(b), link, tree_.links[static_cast<std::size_t>(link)].path,
                                  readings_, usable_, options);
    const auto rest = practical_rest(b, link);
    for (Attachment& a : found) {
      if (rest && !a.driven()) continue;
      if (moves_freely_[b] != 0 && !a.at_rest() && !a.driven()) continue;
      g.alternatives.push_back(std::move(a));
    }
    if (!rest) return;
    g.rests_on = link;
    // Nothing that moves freely stays where it is.
    g.free_cost = std::max(g.free_cost, rest->data_cost + kNeverFree);
    g.everywhere_cost = std::max(g.everywhere_cost, g.free_cost);
    g.alternatives.push_back(*rest);
  }

  // The body at rest on a link, where what is left of it is so small that no robot moves by it:
  // corners that err alike from frame to frame (compression, one light) pass for a slow motion in
  // the statistics, but not in millimetres. Medians, so that views spoilt by an occlusion do not
  // matter.
  std::optional<Attachment> practical_rest(std::size_t b, int link) const {
    constexpr double kTurn = 0.01;    // rad
    constexpr double kShift = 0.003;  // of the distance from the camera
    const RelativeMotion relative =
        relative_motion(body(b), tree_.links[static_cast<std::size_t>(link)].path, readings_);
    if (relative.motion.size() < 5) return std::nullopt;
    const Pose reference = relative.motion[relative.motion.size() / 2].pose;
    std::array<std::vector<double>, 6> moves;
    for (const MotionSample& sample : relative.motion) {
      const Pose move = reference.inverse() * sample.pose;
      const Eigen::Vector3d turn = log_rotation(move.rotation);
      for (std::size_t i = 0; i < 3; ++i) {
        moves[i].push_back(turn[static_cast<Eigen::Index>(i)]);
        moves[i + 3].push_back(move.translation[static_cast<Eigen::Index>(i)]);
      }
    }
    Vector6d middle;
    for (std::size_t i = 0; i < 6; ++i) middle[static_cast<Eigen::Index>(i)] = median_of(moves[i]);
    ChainModel model;
    model.mount = reference * Pose{exp_rotation(middle.head<3>()), middle.tail<3>()};
    std::vector<double> turn;
    std::vector<double> shift;
    for (const MotionSample& sample : relative.motion) {
      const Pose left = model.mount.inverse() * sample.pose;
      turn.push_back(log_rotation(left.rotation).norm());
      shift.push_back(left.translation.norm());
    }
    std::vector<double> distance;
    for (const Sighting& s : body(b).at) {
      if (s.seen) distance.push_back(s.pose.translation.norm());
    }
    if (median_of(turn) > kTurn || median_of(shift) > kShift * median_of(distance)) {
      return std::nullopt;
    }
    return attachment_from(fit_chain(relative.motion, readings_.value, model), link, relative,
                           body(b), readings_);
  }

  // Link `link` hangs (at any depth) on body b's own link.
  bool is_below(int link, int b) const {
    for (int l = link; l >= 0; l = tree_.links[static_cast<std::size_t>(l)].parent) {
      if (tree_.links[static_cast<std::size_t>(l)].founder == b) return true;
    }
    return false;
  }

  static const Attachment* best_of(const GrownBody& g) {
    const Attachment* by_data = nullptr;
    for (const Attachment& a : g.alternatives) {
      if (by_data == nullptr || a.data_cost < by_data->data_cost) by_data = &a;
    }
    if (by_data == nullptr) return nullptr;
    const Attachment* best = nullptr;
    for (const Attachment& a : g.alternatives) {
      if (best == nullptr ||
          a.cost(by_data->fit.correlation) < best->cost(by_data->fit.correlation))
        best = &a;
    }
    return best;
  }

  bool acceptable(std::size_t b, const Attachment& a) const {
    if (a.at_rest() && tree_.bodies[b].rests_on == a.parent) return true;
    const GrownBody& g = tree_.bodies[b];
    const double ratio = a.explained_ratio();
    const bool followed = a.driven() && ratio > options_.accept_ratio;
    if (a.data_cost >= g.free_cost && !followed) return false;
    const bool clean = a.fit.variance <= options_.accept_variance || ratio > options_.accept_ratio;
    if (a.at_rest() || a.driven()) return clean;
    // A joint without a channel has to leave much less than it explains, or free bodies pass as
    // joints.
    return clean && ratio > options_.free_ratio;
  }

  // The best of what is known, if it is acceptable. Of a joint that would need to leave less to do
  // without a channel, the same joint with one may be.
  const Attachment* acceptable_best(std::size_t b) const {
    const GrownBody& g = tree_.bodies[b];
    const Attachment* best = best_of(g);
    if (best == nullptr || acceptable(b, *best)) return best;
    if (best->at_rest() || best->driven()) return nullptr;
    const Attachment* driven = nullptr;
    for (const Attachment& a : g.alternatives) {
      if (!a.driven() || a.parent != best->parent || !acceptable(b, a)) continue;
      if (driven == nullptr || a.data_cost < driven->data_cost) driven = &a;
    }
    return driven;
  }

  // Attaches the body that fits best anywhere; false when none is acceptable.
  bool attach_next() {
    std::size_t chosen = tree_.bodies.size();
    double least = kInfinity;
    for (std::size_t b = 0; b < tree_.bodies.size(); ++b) {
      const GrownBody& g = tree_.bodies[b];
      if (g.link >= 0) continue;
      const Attachment* best = acceptable_best(b);
      if (best == nullptr) continue;
      // Rest first, then driven joints, then free coordinates; within each the cleanest.
      const double rank = best->at_rest() ? 0.0 : best->driven() ? 1e3 : 1e6;
      const double badness = rank + best->data_cost / std::max(1, body(b).seen);
      if (badness < least) {
        least = badness;
        chosen = b;
      }
    }
    if (chosen == tree_.bodies.size()) return false;
    place(chosen, *acceptable_best(chosen));
    return true;
  }

  void place(std::size_t b, Attachment attachment) {
    GrownBody& g = tree_.bodies[b];
    g.attachment = attachment;
    if (attachment.at_rest()) {
      g.link = attachment.parent;
      return;
    }
    GrownLink link;
    link.parent = attachment.parent;
    link.founder = static_cast<int>(b);
    link.path = path_of(attachment, body(b),
                        tree_.links[static_cast<std::size_t>(link.parent)].path, readings_);
    link.attachment = std::move(attachment);
    g.link = static_cast<int>(tree_.links.size());
    add_link(std::move(link));
  }

  bool attach_through_unseen_links() {
    std::vector<char> unused = usable_;
    for (const GrownLink& l : tree_.links) {
      for (const ChainJoint& j : l.attachment.fit.model.joints) {
        if (!j.terms.empty()) unused[static_cast<std::size_t>(j.terms.front().channel)] = 0;
      }
    }
    struct Case {
      std::size_t body;
      std::size_t link;
      SerialOutlook outlook;
    };
    std::vector<Case> cases;
    for (std::size_t b = 0; b < tree_.bodies.size(); ++b) {
      for (std::size_t l = 0; l < tree_.links.size() && tree_.bodies[b].link < 0; ++l) {
        const SerialOutlook o = serial_outlook(body(b), tree_.links[l].path, readings_, unused);
        if (o.channels > 0) cases.push_back({b, l, o});
      }
    }
    std::ranges::stable_sort(
        cases, {}, [](const Case& c) { return std::pair(c.outlook.channels, c.outlook.residual); });
    constexpr std::size_t kMostCases = 6;
    for (std::size_t i = 0; i < std::min(cases.size(), kMostCases); ++i) {
      const Case& c = cases[i];
      auto found = find_serial_attachment(body(c.body), static_cast<int>(c.link),
                                          tree_.links[c.link].path, readings_, unused);
      if (!found || !acceptable(static_cast<std::size_t>(c.body), *found)) continue;
      tree_.bodies[c.body].alternatives.push_back(*found);
      place(c.body, std::move(*found));
      return true;
    }
    return false;
  }

  // A joint that no channel drives stands on one marker's word: that its motion has one direction.
  // Where another marker of the same rigid body moves by no joint, the body only happened to keep
  // to a line while the first one was seen, and is free. True when such a joint was taken out.
  bool give_up_contradicted_joint() {
    for (std::size_t l = 1; l < tree_.links.size(); ++l) {
      if (tree_.links[l].attachment.driven()) continue;
      const auto founder = static_cast<std::size_t>(tree_.links[l].founder);
      for (std::size_t b = 0; b < tree_.bodies.size(); ++b) {
        if (tree_.bodies[b].link >= 0 || !rest_on_each_other(founder, b)) continue;
        set_free(static_cast<int>(l));
        return true;
      }
    }
    return false;
  }

  // Whether two bodies keep one relative pose wherever both are seen.
  bool rest_on_each_other(std::size_t a, std::size_t b) const {
    constexpr std::size_t kFewest = 12;
    constexpr double kNoiseOnly = 4.0;  // variance over the declared one; or
    constexpr double kOfMotion = 0.1;   // what is left over how far they move
    constexpr double kLever = 0.3;      // m, at which turns are compared with shifts
    LinkPath path = camera_path(series_.size());
    path.covariance.assign(path.pose.size(), Matrix6d::Zero());
    for (std::size_t i = 0; i < path.pose.size(); ++i) {
      const Sighting& s = body(a).at[i];
      path.valid[i] = s.seen ? 1 : 0;
      if (!s.seen) continue;
      path.pose[i] = s.pose;
      path.covariance[i] = s.covariance;
    }
    const RelativeMotion relative = relative_motion(body(b), path, readings_);
    if (relative.motion.size() < kFewest) return false;
    ChainModel model;
    model.mount = relative.motion[relative.motion.size() / 2].pose;
    const ChainFit fit = fit_chain(relative.motion, readings_.value, model);
    const double left = std::hypot(fit.translation_rms, kLever * fit.rotation_rms);
    return fit.variance < kNoiseOnly || left < kOfMotion * tree_.bodies[a].attachment.motion_size;
  }

  // Takes out a link and everything on it; its bodies may no longer hang by joints without
  // channels.
  void set_free(int link) {
    const int founder = tree_.links[static_cast<std::size_t>(link)].founder;
    for (std::size_t b = 0; b < tree_.bodies.size(); ++b) {
      if (tree_.bodies[b].link < 0 || !is_below(tree_.bodies[b].link, founder)) continue;
      if (tree_.bodies[b].link == link) moves_freely_[b] = 1;
      tree_.bodies[b].link = -1;
    }
    static_cast<void>(remove_links_without_bodies());
    relist();
    while (attach_next()) {
    }
  }

  // Moves single bodies to better places, then deals out the channels; true when anything changed.
  bool rearrange() {
    bool changed = false;
    for (std::size_t b = 0; b < tree_.bodies.size(); ++b) changed = improve(b) || changed;
    changed = settle_channels() || changed;
    return changed;
  }

  bool improve(std::size_t b) {
    GrownBody& g = tree_.bodies[b];
    if (g.link < 0) return false;
    const Attachment* best = nullptr;
    double least = g.attachment.cost(g.attachment.fit.correlation) - 1e-6;
    for (const Attachment& a : g.alternatives) {
      if (is_below(a.parent, static_cast<int>(b)) || conflicts(b, a)) continue;
      const double cost = a.cost(g.attachment.fit.correlation);
      if (cost >= least) continue;
      least = cost;
      best = &a;
    }
    if (best == nullptr) return false;
    move(b, *best);
    return true;
  }

  // The attachment's main channel already drives another joint, which has no other to take instead.
  bool conflicts(std::size_t b, const Attachment& a) const {
    if (!a.driven()) return false;
    for (const GrownLink& l : tree_.links) {
      if (l.founder < 0 || l.founder == static_cast<int>(b) ||
          l.attachment.channel() != a.channel())
        continue;
      if (l.attachment.fit.model.joints.front().terms.size() == 1) return true;
    }
    return false;
  }

  void move(std::size_t b, Attachment attachment) {
    GrownBody& g = tree_.bodies[b];
    const int own = own_link(b);
    g.attachment = attachment;
    if (own >= 0 && !attachment.at_rest()) {
      GrownLink& link = tree_.links[static_cast<std::size_t>(own)];
      link.parent = attachment.parent;
      link.attachment = std::move(attachment);
      refresh(own);
    } else if (own >= 0) {
      dissolve(own, std::move(attachment));
    } else if (attachment.at_rest()) {
      g.link = attachment.parent;
    } else {
      place(b, std::move(attachment));
    }
  }

  int own_link(std::size_t b) const {
    for (std::size_t l = 1; l < tree_.links.size(); ++l) {
      if (tree_.links[l].founder == static_cast<int>(b)) return static_cast<int>(l);
    }
    return -1;
  }

  // The founder of `own` turns out to rest on another link: everything on `own` is looked at anew.
  void dissolve(int own, Attachment attachment) {
    std::vector<std::size_t> homeless;
    for (std::size_t b = 0; b < tree_.bodies.size(); ++b) {
      if (is_below(tree_.bodies[b].link, tree_.links[static_cast<std::size_t>(own)].founder))
        homeless.push_back(b);
    }
    const auto founder =
        static_cast<std::size_t>(tree_.links[static_cast<std::size_t>(own)].founder);
    for (const std::size_t b : homeless) tree_.bodies[b].link = -1;
    const std::vector<int> renamed = remove_links_without_bodies();
    attachment.parent = renamed[static_cast<std::size_t>(attachment.parent)];
    tree_.bodies[founder].link = attachment.parent;
    tree_.bodies[founder].attachment = std::move(attachment);
    relist();
    while (attach_next()) {
    }
  }

  // Gives the new number of every link, -1 for those that are gone.
  std::vector<int> remove_links_without_bodies() {
    std::vector<int> renamed(tree_.links.size(), -1);
    std::vector<GrownLink> kept;
    for (std::size_t l = 0; l < tree_.links.size(); ++l) {
      const int founder = tree_.links[l].founder;
      if (founder >= 0 &&
          tree_.bodies[static_cast<std::size_t>(founder)].link != static_cast<int>(l))
        continue;
      renamed[l] = static_cast<int>(kept.size());
      kept.push_back(std::move(tree_.links[l]));
      GrownLink& link = kept.back();
      if (link.parent < 0) continue;
      link.parent = renamed[static_cast<std::size_t>(link.parent)];
      link.attachment.parent = link.parent;
    }
    tree_.links = std::move(kept);
    for (GrownBody& g : tree_.bodies) {
      g.alternatives.clear();
      if (g.link < 0) continue;
      g.link = renamed[static_cast<std::size_t>(g.link)];
      g.attachment.parent = renamed[static_cast<std::size_t>(g.attachment.parent)];
    }
    return renamed;
  }

  void relist() {
    for (std::size_t l = 0; l < tree_.links.size(); ++l) {
      for (std::size_t b = 0; b < tree_.bodies.size(); ++b) look_at(b, static_cast<int>(l));
    }
  }

  // Recomputes the paths at and below a link, and what was said against them.
  void refresh(int link) {
    sort_links(link);
    std::vector<int> touched;
    for (std::size_t l = 1; l < tree_.links.size(); ++l) {
      GrownLink& g = tree_.links[l];
      const bool below =
          static_cast<int>(l) == link || std::ranges::find(touched, g.parent) != touched.end();
      if (!below) continue;
      touched.push_back(static_cast<int>(l));
      const Body& founder = body(static_cast<std::size_t>(g.founder));
      const LinkPath& parent = tree_.links[static_cast<std::size_t>(g.parent)].path;
      if (static_cast<int>(l) != link)
        g.attachment = refit(g.attachment, founder, parent, readings_);
      tree_.bodies[static_cast<std::size_t>(g.founder)].attachment = g.attachment;
      g.path = path_of(g.attachment, founder, parent, readings_);
    }
    for (std::size_t b = 0; b < tree_.bodies.size(); ++b) {
      GrownBody& g = tree_.bodies[b];
      std::erase_if(g.alternatives, [&](const Attachment& a) {
        return std::ranges::find(touched, a.parent) != touched.end();
      });
      for (const int l : touched) look_at(b, l);
      if (g.attachment.at_rest() && std::ranges::find(touched, g.link) != touched.end()) {
        g.attachment = refit(g.attachment, body(b),
                             tree_.links[static_cast<std::size_t>(g.link)].path, readings_);
      }
    }
  }

  // Puts parents before children again after `moved` changed its parent; `moved` follows its new
  // number.
  void sort_links(int& moved) {
    std::vector<int> renamed(tree_.links.size(), -1);
    std::vector<GrownLink> sorted;
    renamed[0] = 0;
    sorted.push_back(std::move(tree_.links[0]));
    for (bool again = true; again;) {
      again = false;
      for (std::size_t l = 1; l < tree_.links.size(); ++l) {
        if (renamed[l] >= 0 || renamed[static_cast<std::size_t>(tree_.links[l].parent)] < 0)
          continue;
        renamed[l] = static_cast<int>(sorted.size());
        sorted.push_back(std::move(tree_.links[l]));
        sorted.back().parent = renamed[static_cast<std::size_t>(sorted.back().parent)];
        sorted.back().attachment.parent = sorted.back().parent;
        again = true;
      }
    }
    tree_.links = std::move(sorted);
    for (GrownBody& g : tree_.bodies) {
      if (g.link >= 0) g.link = renamed[static_cast<std::size_t>(g.link)];
      g.attachment.parent = renamed[static_cast<std::size_t>(g.attachment.parent)];
      for (Attachment& a : g.alternatives) a.parent = renamed[static_cast<std::size_t>(a.parent)];
    }
    moved = renamed[static_cast<std::size_t>(moved)];
  }

  // Every channel is the main one of one joint: coupled joints take another of theirs where that
  // helps; of two joints that still share one, the one that loses least takes its next best
  // explanation.
  bool settle_channels() {
    deal_main_channels();
    bool changed = false;
    for (std::size_t l = 1; l < tree_.links.size(); ++l) {
      for (std::size_t m = l + 1; m < tree_.links.size(); ++m) {
        const int channel = tree_.links[l].attachment.channel();
        if (channel < 0 || channel != tree_.links[m].attachment.channel()) continue;
        changed = resolve(l, m, channel) || changed;
      }
    }
    return changed;
  }

  // Largest matching of joints and channels they depend on (Kuhn's augmenting paths), stronger
  // terms first.
  void deal_main_channels() {
    std::vector<std::size_t> single;
    for (std::size_t l = 1; l < tree_.links.size(); ++l) {
      if (tree_.links[l].attachment.driven() &&
          tree_.links[l].attachment.fit.model.joints.size() == 1) {
        single.push_back(l);
      }
    }
    std::vector<int> owner(usable_.size(), -1);
    std::ranges::stable_sort(single, {}, [&](std::size_t l) { return terms_of(l).size(); });
    for (const std::size_t l : single) {
      std::vector<char> visited(usable_.size(), 0);
      static_cast<void>(claim(static_cast<int>(l), owner, visited));
    }
    for (std::size_t c = 0; c < owner.size(); ++c) {
      if (owner[c] >= 0) make_main(static_cast<std::size_t>(owner[c]), static_cast<int>(c));
    }
  }

  std::vector<ChainTerm>& terms_of(std::size_t link) {
    return tree_.links[link].attachment.fit.model.joints.front().terms;
  }

  bool claim(int link, std::vector<int>& owner, std::vector<char>& visited) {
    for (const ChainTerm& t : terms_of(static_cast<std::size_t>(link))) {
      const auto c = static_cast<std::size_t>(t.channel);
      if (visited[c] != 0) continue;
      visited[c] = 1;
      if (owner[c] >= 0 && !claim(owner[c], owner, visited)) continue;
      owner[c] = link;
      return true;
    }
    return false;
  }

  void make_main(std::size_t link, int channel) {
    auto& terms = terms_of(link);
    for (std::size_t t = 1; t < terms.size(); ++t) {
      if (terms[t].channel != channel) continue;
      std::swap(terms[0], terms[t]);
      auto& sigma = tree_.links[link].attachment.fit.scale_sigma;
      std::swap(sigma[0], sigma[t]);
    }
    tree_.bodies[static_cast<std::size_t>(tree_.links[link].founder)].attachment =
        tree_.links[link].attachment;
  }

  bool resolve(std::size_t l, std::size_t m, int channel) {
    const Attachment* other_l = without_channel(tree_.links[l], channel);
    const Attachment* other_m = without_channel(tree_.links[m], channel);
    const auto loss = [&](std::size_t link, const Attachment* other) {
      if (other == nullptr) return kInfinity;
      const Attachment& now = tree_.links[link].attachment;
      return other->cost(now.fit.correlation) - now.cost(now.fit.correlation);
    };
    const double loss_l = loss(l, other_l);
    const double loss_m = loss(m, other_m);
    if (loss_l == kInfinity && loss_m == kInfinity) return false;
    const bool take_l = loss_l < loss_m;
    const auto founder = static_cast<std::size_t>(tree_.links[take_l ? l : m].founder);
    move(founder, Attachment(take_l ? *other_l : *other_m));
    return true;
  }

  const Attachment* without_channel(const GrownLink& link, int channel) const {
    const GrownBody& g = tree_.bodies[static_cast<std::size_t>(link.founder)];
    const Attachment* best = nullptr;
    const double correlation = link.attachment.fit.correlation;
    for (const Attachment& a : g.alternatives) {
      if (a.channel() == channel || is_below(a.parent, link.founder)) continue;
      if (conflicts(static_cast<std::size_t>(link.founder), a)) continue;
      if (!acceptable(static_cast<std::size_t>(link.founder), a)) continue;
      if (best == nullptr || a.cost(correlation) < best->cost(correlation)) best = &a;
    }
    return best;
  }

  const Series& series_;
  const Readings& readings_;
  GrowthOptions options_;
  std::vector<char> usable_;
  std::vector<char> moves_freely_;  // bodies whose joint without a channel was given up
  GrownTree tree_;
};

}  // namespace

GrownTree grow_tree(const Series& series, const Readings& readings, const GrowthOptions& options) {
  return Grower(series, readings, options).run();
}

GrownTree refit_tree(const GrownTree& tree, const Series& series, const Readings& readings) {
  GrownTree out = tree;
  out.links.front().path = camera_path(series.size());
  for (std::size_t l = 1; l < out.links.size(); ++l) {
    GrownLink& link = out.links[l];
    const auto founder = static_cast<std::size_t>(link.founder);
    const LinkPath& parent = out.links[static_cast<std::size_t>(link.parent)].path;
    link.attachment = refit(link.attachment, series.bodies[founder], parent, readings);
    out.bodies[founder].attachment = link.attachment;
    link.path = path_of(link.attachment, series.bodies[founder], parent, readings);
  }
  for (std::size_t b = 0; b < out.bodies.size(); ++b) {
    GrownBody& body = out.bodies[b];
    if (body.link < 0 || !body.attachment.at_rest()) continue;
    body.attachment = refit(body.attachment, series.bodies[b],
                            out.links[static_cast<std::size_t>(body.link)].path, readings);
  }
  return out;
}

double tree_cost(const GrownTree& tree) {
  double sum = 0.0;
  for (const GrownBody& b : tree.bodies) sum += b.link < 0 ? b.free_cost : b.attachment.data_cost;
  return sum;
}

}  // namespace kinescope::structure_search
