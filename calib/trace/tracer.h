// SPDX-License-Identifier: Apache-2.0
//
// The search: forward selection (tracer.cpp), backward check and what cannot be told apart
// (tracer_backward.cpp), what is left (tracer_rest.cpp), repeats (tracer_curves.cpp) or has plain
// causes (tracer_plain.cpp), the answer in numbers (tracer_answer.cpp; its verdict: verdict.h).
#pragma once

#include <cstddef>
#include <deque>
#include <optional>
#include <set>
#include <string>
#include <string_view>
#include <vector>

#include "calib/trace/encompassing.h"
#include "calib/trace/family.h"
#include "calib/trace/lasting.h"
#include "calib/trace/rest.h"
#include "calib/trace/stage.h"
#include "calib/trace/trace.h"

namespace kinescope::trace {

// Several waves at one place are what any function is made of: a rest, not effects.
inline constexpr std::ptrdiff_t kMostAlike = 3;
// Of what several waves explain, held out, that a curve in their stead may leave.
inline constexpr double kSmallLoss = 0.05;
// A rest that explains this much of what a named effect at its place explains puts that name in
// doubt.
inline constexpr double kDoubtfulShare = 0.1;
/// The first step, in words.
inline constexpr std::string_view kModelAsItIs = "the model as it is";

class Tracer {
 public:
  Tracer(const TracedModel& model, const TraceOptions& options, const Progress& progress);
  [[nodiscard]] Trace run();
  /// first_effect() of trace.h.
  [[nodiscard]] std::optional<AddedEffect> first();
  /// size_again() of trace.h.
  void size_again(Trace& found);

 private:
  // What the backward check says of an added effect.
  struct Detail {
    TracedEffect effect;
    Score score;  // without it, with all the others
  };

  // A significant candidate with what the linear model says of it, held out.
  struct Contender {
    TestedMember member;
    EffectId id;
    Eigen::VectorXd held_out;  // whitened squared errors by instant
  };

  /// The model with these effects; those asked for last are kept.
  [[nodiscard]] StagePtr stage_of(std::vector<AddedEffect> effects);
  [[nodiscard]] bool can_look(const Stage& stage);
  // Adds them all at once: beside a large one that is missing, others stand in for it.
  void begin_with_what_is_expected();
  [[nodiscard]] bool is_added(const EffectId& id) const;
  /// Of an effect that was added: as it is offered where it was fitted (what a size is counted in
  /// depends on that fit), or without any.
  [[nodiscard]] const Candidate& candidate_of(const EffectId& id) const;
  /// TraceOptions::most_fits.
  [[nodiscard]] bool may_go_on() const;
  void say_nothing(std::string reason);
  void search();
  void forward();
  /// Beyond what the sensor's own errors do, or shown by more than its own rows to be there.
  [[nodiscard]] bool is_large(const Candidate& candidate, double scan, const Score& score) const;
  /// Seen at all, large enough, possible, and not taken out before; significance apart.
  [[nodiscard]] bool may_be_added(const Candidate& candidate, double scan,
                                  const Score& score) const;
  /// Of a family of the system, those that are shown for certain.
  [[nodiscard]] std::vector<Contender> contenders(const NormalSystem& system,
                                                  const std::vector<Candidate>& candidates,
                                                  const std::vector<TestedMember>& family) const;
  [[nodiscard]] std::vector<Contender> contenders(const Stage& stage,
                                                  const std::vector<TestedMember>& family) const {
    return contenders(stage.system, stage.fit.candidates, family);
  }
  /// To first order, beside the hint: no refit.
  [[nodiscard]] bool shows_another(const Stage& stage, const TestedMember& hint) const;
  [[nodiscard]] StagePtr refit_best(const std::vector<Contender>& contenders, int round);
  [[nodiscard]] StagePtr look_ahead(const std::vector<TestedMember>& family);
  /// Shown for certain, and explains most of those.
  [[nodiscard]] const TestedMember* most_below_floors(
      const std::vector<TestedMember>& family) const;
  /// The effects that there are, and this one.
  [[nodiscard]] StagePtr with(const TestedMember& member);
  [[nodiscard]] StagePtr or_what_is_below_floors(StagePtr found,
                                                 const std::vector<TestedMember>& family);
  [[nodiscard]] bool is_of_the_sensor(const Stage& found, const std::vector<TestedMember>& family);
  /// Of those that may be added, the one that explains most, significant or not.
  [[nodiscard]] const TestedMember* most_telling(const Stage& stage,
                                                 const std::vector<TestedMember>& family) const;
  /// The best effects one after the other, from this one on, beside those that there are, until all
  /// are needed to predict.
  [[nodiscard]] StagePtr chain(const AddedEffect& first);
  /// Without those beyond the first `known` that predict no better for being there.
  [[nodiscard]] StagePtr without_idle(StagePtr stage, std::size_t known);
  /// All effects beyond the first `known` are: what is left with all in judges.
  [[nodiscard]] bool all_needed(const Stage& stage, std::size_t known);
  [[nodiscard]] bool is_needed(const Stage& stage, std::size_t index);
  /// True where a value was found that predicts better.
  [[nodiscard]] bool search_again(const std::optional<std::string>& place);
  /// The same at the place of an effect that there can be only one of, where one more would show.
  [[nodiscard]] bool search_again_for_a_second(const std::vector<TestedMember>& family);
  void sharpen(std::size_t index);
  /// Where the size of an effect is the value of its scan, and predicts as well there.
  [[nodiscard]] StagePtr with_sizes_for_scans(StagePtr stage);
  [[nodiscard]] bool simplify();
  [[nodiscard]] bool backward();
  /// An added effect whose size may be nothing.
  [[nodiscard]] std::optional<std::size_t> one_without_size();
  [[nodiscard]] bool is_usual(const EffectId& id) const;
  [[nodiscard]] bool drop_without_size();
  /// For good, with its reason; `less`: the model without it.
  void take_out(std::size_t index, StagePtr less, std::string_view why);
  /// What an effect does, from the model without it.
  void compare_without(const Stage& without, TracedEffect& detail) const;
  /// Other values of the scan that explain what `own` explains, with the size they would have.
  [[nodiscard]] std::vector<ScanAlternative> as_likely(const Stage& without,
                                                       const Candidate& candidate,
                                                       const TestedMember& own) const;
  [[nodiscard]] bool check(std::size_t index);
  [[nodiscard]] bool swap(std::size_t index, const AddedEffect& other, bool likelier, bool plainer);
  [[nodiscard]] bool is_ruled_out(std::size_t index, const AddedEffect& rival);
  [[nodiscard]] Comparison compare_fits(std::size_t index, const AddedEffect& rival);
  [[nodiscard]] bool settle_rivals(std::size_t index, const Stage& without,
                                   const TestedMember& own);
  [[nodiscard]] std::vector<AddedEffect> curves_for_rests() const;
  void tune_curves();
  [[nodiscard]] bool take_the_rest_as_curves();
  [[nodiscard]] bool is_part_of_a_curve(std::size_t wave, std::size_t curve, const Stage& without);
  void drop_what_curves_contain();
  void take_a_curve_for_what_cancels();
  void look_beside_curves();
  void describe_curves();
  void replace_waves_by_a_curve();
  void look_for_rest();
  /// True where an effect that is small in the mean over the rows it touches says as much as what
  /// was found to be left.
  [[nodiscard]] bool name_the_rest();
  /// The same of effects without a scan at one place, together, by the tests of that place alone.
  [[nodiscard]] bool name_by_plain_causes();
  /// Nothing where they do not explain what the curve explains.
  [[nodiscard]] StagePtr plain_causes_of(const FoundRest& found);
  [[nodiscard]] std::optional<AddedEffect> plainest_at(const Stage& stage,
                                                       const std::string& place) const;
  [[nodiscard]] bool all_shown(const Stage& stage, std::size_t known);
  /// By which an effect's single p-value is multiplied.
  [[nodiscard]] double tests_of(const std::vector<Candidate>& candidates,
                                const Candidate& candidate) const;
  /// Of effects that say the same, one that leaves nothing takes the place of one that does.
  [[nodiscard]] bool choose_by_rest();
  [[nodiscard]] std::optional<FoundRest> next_rest() const;
  void add_rest(FoundRest found);
  void look_for_curves();
  [[nodiscard]] bool look_for_field();
  [[nodiscard]] double rest_level() const;
  /// Of two models' whitened squared errors, by instant.
  [[nodiscard]] bool predicts_clearly_worse(const Eigen::VectorXd& one,
                                            const Eigen::VectorXd& other) const;
  /// True where a rest is large enough beside what an effect explains to put its name in doubt.
  [[nodiscard]] bool is_doubtful(const FoundRest& found, std::size_t effect) const;
  [[nodiscard]] bool drop_what_rests_explain();
  [[nodiscard]] bool predicts_beside(const std::vector<FoundRest>& curves,
                                     const NormalSystem& less) const;
  [[nodiscard]] bool says_as_much(const Stage& without, FoundRest alone,
                                  const FoundRest& found) const;
  [[nodiscard]] bool rest_replaces_an_effect(const FoundRest& found);
  /// Squares that neither effects nor what was found beside them explain.
  [[nodiscard]] double left_over() const;
  [[nodiscard]] bool drop_what_leaves_too_much();
  /// The same place by place, where their noise is known by itself.
  [[nodiscard]] bool drop_beside_what_lasts();
  [[nodiscard]] std::vector<LeftOver> left_by_place() const;
  void record(const std::vector<TestedMember>& family, const Stage& stage, int round);
  void mark(int round, const EffectId& id, CandidateState state, std::optional<double> held_out);
  void add_step(int round, std::string words, const Stage& stage);
  void summarise();
  /// What an added effect is in numbers, as it is fitted; `covariance` of its values.
  void size_up(std::size_t index, const Eigen::MatrixXd& covariance, TracedEffect& effect) const;

  const TracedModel* model_;
  TraceOptions options_;
  Progress progress_;
  double level_ = 0.0;  // of all tests of known effects; the same again for the rest
  std::deque<StagePtr> last_;
  StagePtr base_;
  StagePtr now_;
  std::vector<Detail> details_;  // beside now_->added, filled by the backward check
  std::set<EffectId> removed_;
  std::set<EffectId> small_;   // may be added below the floors
  std::set<EffectId> plain_;   // found as causes of what was left at their place
  std::set<EffectId> needed_;  // a plainer one in their place leaves a rest
  std::vector<FoundRest> rests_;
  int round_ = 0;
  int fits_ = 0;
  bool is_ended_ = false;            // by TraceOptions::until
  bool known_searched_ = false;      // the scans of TraceOptions::start, once more
  bool look_ahead_put_off_ = false;  // by the last forward()
  StagePtr checked_;  // the backward check left it as it is, after a look ahead was put off
  Trace trace_;
};

}  // namespace kinescope::trace
