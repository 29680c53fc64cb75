// SPDX-License-Identifier: Apache-2.0
#include "kinematics/structure/verdict.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "kinematics/core/median.h"
#include "kinematics/structure/idle_channels.h"
#include "kinematics/structure/move_bodies.h"
#include "kinematics/structure/natural_units.h"

namespace kinescope::structure_search {
namespace {

// Larger log-odds mean nothing: the models are not that right.
constexpr double kMostLogOdds = 1000.0;
// Channels that agree this well hold the same numbers, perhaps in another unit.
constexpr double kAlike = 1.0 - 1e-9;
// -2 ln odds (1 : 20) that usual units alone may give an answer that the motion does not: less than
// an answer needs.
constexpr double kUnitsAlone = 6.0;
// Channels that agree this well move together.
constexpr double kTogether = 0.995;
// A channel that moves less than this many times what a marker could show is one that hardly moves.
constexpr double kVisible = 6.0;

std::string channel_words(const JointLog& log, const Readings& readings, int channel) {
  return fmt::format("'{}'", log.channels[static_cast<std::size_t>(
                                 readings.log_channel[static_cast<std::size_t>(channel)])]);
}

std::string type_words(const Attachment& a) {
  if (a.at_rest()) return "fixed";
  if (a.fit.model.joints.size() > 1)
    return fmt::format("{} joints in series", a.fit.model.joints.size());
  return a.fit.model.joints.front().type == JointType::kRevolute ? "turning" : "sliding";
}

// Same parent, type and main channel: the same answer.
bool same_answer(const Attachment& a, const Attachment& b) {
  if (a.parent != b.parent || a.fit.model.joints.size() != b.fit.model.joints.size()) return false;
  if (a.at_rest()) return true;
  if (a.channel() != b.channel()) {
    // A coupled joint is the same whichever of its channels is called the main one.
    const auto has = [](const Attachment& x, int c) {
      return std::ranges::any_of(x.fit.model.joints.front().terms,
                                 [&](const ChainTerm& t) { return t.channel == c; });
    };
    if (!a.driven() || !b.driven() || !has(a, b.channel()) || !has(b, a.channel())) return false;
  }
  for (std::size_t k = 0; k < a.fit.model.joints.size(); ++k) {
    if (a.fit.model.joints[k].type != b.fit.model.joints[k].type) return false;
  }
  return true;
}

struct Alternative {
  double loss = std::numeric_limits<double>::infinity();  // -2 ln odds against the answer
  std::string words;
  int first_channel = -1;  // the two channels that could be exchanged
  int second_channel = -1;
  int link = -1;  // whose joint it is about; -1: of a body at rest
  std::size_t body = 0;
  const Attachment* place = nullptr;  // of the body; null: it is not about one body's place
  std::string instead_of = {};        // where the answer has the body, in words
};

class Judge {
 public:
  Judge(const GrownTree& tree, const Series& series, const Readings& readings, const JointLog& log)
      : tree_(tree), series_(series), readings_(readings), log_(log) {}

  std::vector<Alternative> alternatives() const {
    std::vector<Alternative> out;
    for (std::size_t b = 0; b < tree_.bodies.size(); ++b) {
      add_of_body(b, out);
      add_orders(b, out);
    }
    add_exchanges(out);
    add_rivals(out);
    return out;
  }

 private:
  void add_of_body(std::size_t b, std::vector<Alternative>& out) const {
    const GrownBody& body = tree_.bodies[b];
    if (body.link < 0) return;
    const double correlation = body.attachment.fit.correlation;
    const double now = body.attachment.cost(correlation);
    std::vector<const Attachment*> listed;
    for (const Attachment& a : body.alternatives) {
      if (same_answer(a, body.attachment) || is_below(tree_, a.parent, b)) continue;
      const bool again =
          std::ranges::any_of(listed, [&](const Attachment* l) { return same_answer(*l, a); });
      if (again) continue;
      listed.push_back(&a);
      Alternative alternative;
      alternative.loss =
          std::max(0.0, a.cost(correlation) - now + exchange_loss(b, a) + idle_loss(b, a));
      alternative.words = words(b, a);
      alternative.first_channel = body.attachment.channel();
      alternative.second_channel = a.channel();
      alternative.link = own_link(tree_, b);
      alternative.body = b;
      alternative.place = &a;
      alternative.instead_of = words(b, body.attachment);
      out.push_back(std::move(alternative));
    }
    const double free_loss = body.everywhere_cost / correlation - now;
    out.push_back({std::max(0.0, free_loss),
                   fmt::format("tag {} moves freely", series_.bodies[b].id.value), -1, -1,
                   own_link(tree_, b)});
  }

  // What the alternative changes in how many channels drive nothing; those of exchanged channels
  // change nothing.
  double idle_loss(std::size_t b, const Attachment& a) const {
    return conflicts(tree_, b, a) ? 0.0 : idle_change(tree_, readings_, b, a);
  }

  void add_rivals(std::vector<Alternative>& out) const {
    for (const RivalTree& rival : tree_.rivals) {
      out.push_back({std::max(0.0, rival.loss),
                     fmt::format("tag {} on another link, and others with it",
                                 series_.bodies[rival.body].id.value),
                     -1, -1, own_link(tree_, rival.body)});
    }
  }

  // What the joint that has the alternative's channel now would lose by giving it up.
  double exchange_loss(std::size_t b, const Attachment& a) const {
    if (!a.driven()) return 0.0;
    for (const GrownLink& link : tree_.links) {
      if (link.founder < 0 || link.founder == static_cast<int>(b) ||
          link.attachment.channel() != a.channel()) {
        continue;
      }
      const auto founder = static_cast<std::size_t>(link.founder);
      const GrownBody& other = tree_.bodies[founder];
      double least = 200.0;
      for (const Attachment& x : other.alternatives) {
        if (x.channel() == a.channel() || is_below(tree_, x.parent, founder)) continue;
        const double k = link.attachment.fit.correlation;
        least = std::min(least, x.cost(k) - link.attachment.cost(k));
      }
      return std::max(0.0, least);
    }
    return 0.0;
  }

  void add_orders(std::size_t b, std::vector<Alternative>& out) const {
    const GrownBody& body = tree_.bodies[b];
    if (own_link(tree_, b) < 0) return;
    for (const OrderDoubt& d : body.attachment.order_doubts) {
      out.push_back({d.loss / body.attachment.fit.correlation,
                     fmt::format("the joints of {} and {} in the other order",
                                 channel_words(log_, readings_, d.first),
                                 channel_words(log_, readings_, d.second)),
                     -1, -1, own_link(tree_, b)});
    }
  }

  void add_exchanges(std::vector<Alternative>& out) const {
    for (const Exchange& exchange : possible_exchanges(tree_, readings_)) {
      const int first = tree_.link(exchange.first_link).attachment.channel();
      const int second = tree_.link(exchange.second_link).attachment.channel();
      const std::string words =
          fmt::format("channels {} and {} exchanged", channel_words(log_, readings_, first),
                      channel_words(log_, readings_, second));
      if (exchange.loss > kUnitsAlone) {
        const double loss = exchange.declared ? exchange.loss : kUnitsAlone;
        out.push_back({loss, words, -1, -1, exchange.first_link});
      } else {
        out.push_back({std::max(0.0, exchange.loss), words, first, second, exchange.first_link});
      }
    }
  }

  std::string words(std::size_t b, const Attachment& a) const {
    std::string text = fmt::format("tag {} on {}, {}", series_.bodies[b].id.value,
                                   link_words(tree_, series_, a.parent), type_words(a));
    if (a.driven())
      text += fmt::format(" by channel {}", channel_words(log_, readings_, a.channel()));
    else if (!a.at_rest())
      text += " without a channel";
    return text;
  }

  const GrownTree& tree_;
  const Series& series_;
  const Readings& readings_;
  const JointLog& log_;
};

void add_together_doubts(const std::vector<Alternative>& alternatives, const Readings& readings,
                         const JointLog& log, const StructureOptions& options, Verdict& verdict) {
  std::vector<std::pair<int, int>> told;
  for (const Alternative& a : alternatives) {
    if (a.first_channel < 0 || a.second_channel < 0 || a.first_channel == a.second_channel ||
        a.loss > 2.0 * options.min_log_odds)
      continue;
    const std::pair<int, int> pair = std::minmax(a.first_channel, a.second_channel);
    if (std::ranges::find(told, pair) != told.end()) continue;
    const double together = std::abs(channel_correlation(readings, pair.first, pair.second));
    if (together < kTogether) continue;
    told.push_back(pair);
    const std::string first = channel_words(log, readings, pair.first);
    const std::string second = channel_words(log, readings, pair.second);
    const bool alike = together > kAlike;
    verdict.doubts.push_back(
        {fmt::format(
             "channels {} and {} move together: which of them drives which joint cannot be told",
             first, second),
         fmt::format("{}record again with {} and {} moving at different times or speeds",
                     alike ? "if one column is a copy of the other, remove it; else "
                           : "if one column is the command of the other, remove it; else ",
                     first, second),
         {first.substr(1, first.size() - 2), second.substr(1, second.size() - 2)}});
    verdict.status = StructureStatus::kUndetermined;
  }
}

// Which of two proportional channels drives which joint is told by their scales alone.
void add_proportional_doubts(const GrownTree& tree, const Readings& readings, const JointLog& log,
                             Verdict& verdict) {
  for (const Exchange& exchange : possible_exchanges(tree, readings)) {
    // Declared units settle it; a small loss is said as moving together.
    if (exchange.declared || exchange.loss <= kUnitsAlone) continue;
    const std::string first =
        channel_words(log, readings, tree.link(exchange.first_link).attachment.channel());
    const std::string second =
        channel_words(log, readings, tree.link(exchange.second_link).attachment.channel());
    verdict.doubts.push_back(
        {fmt::format("channels {} and {} are multiples of each other: which drives which joint is "
                     "told by their units only",
                     first, second),
         fmt::format("record again with {} and {} moving at different times or speeds", first,
                     second),
         {first.substr(1, first.size() - 2), second.substr(1, second.size() - 2)}});
  }
}

// rad or m per unit of a channel, as the found joints have it; 1 where there are none.
double usual_scale(const GrownTree& tree, const Readings& readings) {
  std::vector<double> scales;
  for (const GrownLink& link : tree.links) {
    if (link.founder < 0 || !link.attachment.driven()) continue;
    const ChainTerm& t = link.attachment.fit.model.joints.front().terms.front();
    scales.push_back(std::abs(t.scale) / readings.rms[static_cast<std::size_t>(t.channel)]);
  }
  return scales.empty() ? 1.0 : median_of(std::move(scales));
}

// The smallest motion (rad or m, RMS) that the best marker would show.
double visible_motion(const Series& series) {
  double least = std::numeric_limits<double>::infinity();
  for (const Body& body : series.bodies) {
    double sum = 0.0;
    for (const Sighting& s : body.at)
      sum += s.seen ? s.covariance.topLeftCorner<3, 3>().trace() / 3.0 : 0.0;
    if (body.seen > 0) least = std::min(least, std::sqrt(sum / body.seen / body.seen));
  }
  return kVisible * least;
}

bool drives_something(const GrownTree& tree, int channel) {
  for (const GrownLink& link : tree.links) {
    if (link.founder < 0) continue;
    for (const ChainJoint& j : link.attachment.fit.model.joints) {
      for (const ChainTerm& t : j.terms) {
        if (t.channel == channel) return true;
      }
    }
  }
  return false;
}

// Columns that never change are a gripper that stays closed, a flag, an axis nobody uses: markers
// that never move against each other are one link of this recording.
void add_constant_doubt(const GrownTree& tree, const Readings& readings, const JointLog& log,
                        Verdict& verdict) {
  std::vector<std::string> quoted;
  std::vector<std::string> names;
  for (int c = 0; c < readings.channels(); ++c) {
    if (readings.moves(c) || drives_something(tree, c)) continue;
    quoted.push_back(channel_words(log, readings, c));
    names.push_back(quoted.back().substr(1, quoted.back().size() - 2));
  }
  if (quoted.empty()) return;
  const bool one = quoted.size() == 1;
  const std::string list = fmt::format("{}", fmt::join(quoted, ", "));
  verdict.doubts.push_back(
      {fmt::format("{} {} never change{}: a joint that {} would not be seen, and markers on both "
                   "sides of it count as one link",
                   one ? "channel" : "channels", list, one ? "s" : "",
                   one ? "it drives" : "one of them drives"),
       fmt::format("if {} drives a joint, record again with it moving", one ? list : "one of them"),
       std::move(names)});
}

// What moves less than the best marker would show is as good as at rest.
void add_still_doubts(const GrownTree& tree, const Series& series, const Readings& readings,
                      const JointLog& log, Verdict& verdict) {
  const double scale = usual_scale(tree, readings);
  for (int c = 0; c < readings.channels(); ++c) {
    if (!readings.moves(c) || drives_something(tree, c)) continue;
    const double motion = readings.rms[static_cast<std::size_t>(c)] * scale;
    if (motion > visible_motion(series)) continue;
    const std::string name = channel_words(log, readings, c);
    verdict.doubts.push_back(
        {fmt::format("channel {} hardly moves: a joint that it drives would not be seen, and "
                     "markers on both sides of it count as one link",
                     name),
         fmt::format("if {} drives a joint, record again with it moving over more of its range",
                     name),
         {name.substr(1, name.size() - 2)}});
  }
}

void add_order_doubts(const GrownTree& tree, const Readings& readings, const JointLog& log,
                      const StructureOptions& options, Verdict& verdict) {
  for (const GrownLink& link : tree.links) {
    if (link.founder < 0) continue;
    for (const OrderDoubt& d : link.attachment.order_doubts) {
      if (d.loss / link.attachment.fit.correlation > 2.0 * options.min_log_odds) continue;
      const std::string first = channel_words(log, readings, d.first);
      const std::string second = channel_words(log, readings, d.second);
      verdict.doubts.push_back(
          {fmt::format("the order of the joints of {} and {} is taken from the log: the recording "
                       "fits either order",
                       first, second),
           fmt::format("record postures in which {} and {} are both away from where they rest, or "
                       "put a marker on "
                       "the link between them",
                       first, second),
           {first.substr(1, first.size() - 2), second.substr(1, second.size() - 2)}});
    }
  }
}

void add_free_doubts(const GrownTree& tree, const Series& series, Verdict& verdict) {
  for (std::size_t b = 0; b < tree.bodies.size(); ++b) {
    if (tree.bodies[b].link >= 0) continue;
    const std::string name = fmt::format("tag {}", series.bodies[b].id.value);
    verdict.doubts.push_back({fmt::format("{} moves, but by no joint that could be found", name),
                              fmt::format("if {} belongs to the robot, check that the log has the "
                                          "channels that move it and that the links between carry "
                                          "markers, or give the robot's drawing with --nominal",
                                          name),
                              {fmt::format("tag_{}", series.bodies[b].id.value)}});
  }
}

// Of `all`, where `most` is the largest loss that leaves an answer in doubt.
std::vector<RivalPlace> rival_places(const std::vector<Alternative>& all, double most) {
  constexpr std::size_t kMost = 6;  // each is a calibration
  std::vector<const Alternative*> close;
  for (const Alternative& a : all) {
    if (a.place != nullptr && a.loss < most) close.push_back(&a);
  }
  std::ranges::stable_sort(close, {}, &Alternative::loss);
  if (close.size() > kMost) close.resize(kMost);
  std::vector<RivalPlace> out;
  for (const Alternative* a : close) out.push_back({a->words, a->instead_of, a->body, *a->place});
  return out;
}

// Nothing but places of bodies stands against the answer.
bool are_places(const std::vector<Alternative>& all, double most) {
  return std::ranges::all_of(
      all, [&](const Alternative& a) { return a.loss >= most || a.place != nullptr; });
}

}  // namespace

std::string link_words(const GrownTree& tree, const Series& series, int link) {
  if (link == 0) return "the camera's frame";
  const int founder = tree.links[static_cast<std::size_t>(link)].founder;
  return fmt::format("the link of tag {}",
                     series.bodies[static_cast<std::size_t>(founder)].id.value);
}

StructureDoubt rival_doubt(const std::string& rival) {
  StructureDoubt out{fmt::format("it could also be: {}", rival),
                     "record longer, with larger motions of the joints concerned",
                     {}};
  out.of_rivals = true;
  return out;
}

Verdict judge(const GrownTree& tree, const Series& series, const Readings& readings,
              const JointLog& log, const StructureOptions& options) {
  Verdict verdict;
  verdict.status = StructureStatus::kDetermined;
  const std::vector<Alternative> all = Judge(tree, series, readings, log).alternatives();
  verdict.link_log_odds.assign(tree.links.size(), std::numeric_limits<double>::infinity());
  verdict.link_runner_up.assign(tree.links.size(), "");
  double odds = 0.0;
  double least = std::numeric_limits<double>::infinity();
  for (const Alternative& a : all) {
    odds += std::exp(-0.5 * a.loss);
    if (a.loss < least) {
      least = a.loss;
      verdict.runner_up = a.words;
    }
    if (a.link < 0) continue;
    double& own = verdict.link_log_odds[static_cast<std::size_t>(a.link)];
    if (0.5 * a.loss >= own) continue;
    own = 0.5 * a.loss;
    verdict.link_runner_up[static_cast<std::size_t>(a.link)] = a.words;
  }
  verdict.probability = 1.0 / (1.0 + odds);
  verdict.runner_up_log_odds = std::min(0.5 * least, kMostLogOdds);
  for (double& own : verdict.link_log_odds) own = std::min(own, kMostLogOdds);
  if (verdict.runner_up_log_odds < options.min_log_odds)
    verdict.status = StructureStatus::kAmbiguous;
  if (are_places(all, 2.0 * options.min_log_odds))
    verdict.rivals = rival_places(all, 2.0 * options.min_log_odds);
  add_order_doubts(tree, readings, log, options, verdict);
  add_free_doubts(tree, series, verdict);
  add_together_doubts(all, readings, log, options, verdict);
  add_proportional_doubts(tree, readings, log, verdict);
  add_still_doubts(tree, series, readings, log, verdict);
  if (tree.links.size() < 2) {
    verdict.status = StructureStatus::kUndetermined;
    verdict.doubts.push_back({"no joint was found",
                              "record the robot while every joint moves, one marker on every link",
                              {}});
  } else if (verdict.status == StructureStatus::kAmbiguous) {
    verdict.doubts.push_back(rival_doubt(verdict.runner_up));
  }
  add_constant_doubt(tree, readings, log, verdict);
  return verdict;
}

}  // namespace kinescope::structure_search
