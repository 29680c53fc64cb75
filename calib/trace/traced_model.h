// SPDX-License-Identifier: Apache-2.0
//
// What tracing needs of a model, whatever it is a model of: its residual, how the residual answers
// to the model's own parameters and to effects it may lack, and a fit with some effects in it.
// Rows are whitened; an instant is a frame, a posture or a sample with all its rows.
#pragma once

#include <array>
#include <functional>
#include <string>
#include <vector>

#include <Eigen/Core>
#include <Eigen/SparseCore>

namespace kinescope {

/// Rows lie together: an instant's rows are read at once.
using RowMatrix = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

/// A model at its solution. Rows are grouped by instant, instants in the order of time.
struct Linearisation {
  Eigen::VectorXd residual;        ///< rows, whitened: observed minus predicted
  RowMatrix jacobian;              ///< rows x parameters: d predicted / d parameter; the parameters
                                   ///< of added effects stand last, in their order
  Eigen::MatrixXd prior;           ///< parameters x parameters: information of priors; empty: none
  Eigen::VectorXd prior_gradient;  ///< what the priors pull at the solution, as the residual does
                                   ///< by J'r; empty: nothing
  /// Rows x local parameters, in the same way: parameters that bear on a few neighbouring instants
  /// only, of which there may be many (where in its step an encoder stands). Empty: none.
  Eigen::SparseMatrix<double, Eigen::RowMajor> local;
  Eigen::VectorXd local_information;     ///< of each: of its prior about zero, whitened
  Eigen::VectorXd local_prediction;      ///< rows: what they make of them at the solution
  Eigen::VectorXd local_residual;        ///< rows: the residual at which they are at their best
  Eigen::SparseMatrix<double> carriers;  ///< rows x carriers: what effects act through, as
                                         ///< d predicted / d (a joint's value, a marker's shift ..)
  std::vector<Eigen::Index> first_row;   ///< of every instant, and one past the last
  Eigen::VectorXd time_s;                ///< of every instant
  std::vector<int> fold;  ///< of every instant: unseen postures (or paths) are held out together
  /// Rows: what one whitened unit is in the unit of `unit_name`; 0 for rows that have another unit
  /// and are not counted in errors.
  Eigen::VectorXd unit;
  std::string unit_name;  ///< "px", "m", "N m"
  /// Rows: the body (marker) that was seen, those of one together; empty: rows are of none.
  std::vector<int> body;
  std::vector<std::string> body_names;  ///< "tag_12", by the numbers of `body`
  /// Counted rows that are the coordinates of one point: errors are given as distances.
  int coordinates = 1;
  /// Instants were taken one by one (postures): noise does not carry over from one to the next.
  bool independent_instants = false;
  /// Rows are whitened by how much they differ from their neighbours in time.
  bool whitened_by_neighbours = false;
  /// Rows: the most that noise alone can make of them, whitened (rms), where the model knows that
  /// apart from what it leaves; empty: not known.
  Eigen::VectorXd noise;
  double correlation_time_s = 0.0;  ///< integral time of the residual's autocorrelation

  [[nodiscard]] Eigen::Index instants() const { return time_s.size(); }
  /// Counted among these rows.
  [[nodiscard]] double points(Eigen::Index first, Eigen::Index rows) const {
    return static_cast<double>((unit.segment(first, rows).array() > 0.0).count()) / coordinates;
  }
};

/// One parameter of an effect: prediction changes by parameter x share(instant) x carrier(row).
struct EffectColumn {
  int carrier = 0;
  Eigen::VectorXd share;  ///< instants; empty: 1 everywhere
};

struct EffectParameter {
  std::string name;  ///< "sine", "cosine"
  std::string unit;
};

/// What an effect is called and where it sits. The names are fixed (README, "Effects").
struct EffectId {
  std::string effect;  ///< "gear_error"
  std::string place;   ///< "joint3", "tag_12", "camera", "clock"
  [[nodiscard]] bool operator==(const EffectId&) const = default;
  [[nodiscard]] auto operator<=>(const EffectId&) const = default;
};

/// An effect that the model may lack. All of its parameters are zero when it is absent.
struct Candidate {
  EffectId id;
  std::string words;  ///< "the encoder of joint3 runs out of centre"
  /// Of a first parameter above and below zero; empty: `words` say it all.
  std::array<std::string, 2> signed_words;
  std::string check;   ///< what to look at on the robot
  std::string record;  ///< what to record so that it shows
  /// Effects that this one refines: it waits while one of them helps, and gives way to one that
  /// says as much (friction before a friction curve; Chipman 1996, heredity).
  std::vector<EffectId> refines;
  /// Effects that are special cases of this one, which therefore is no rival of theirs: what it
  /// says beyond them the search would have found.
  std::vector<EffectId> contains;
  /// All that is of this kind has some of it (friction): what is left at its place and is less than
  /// it explains is beside it, and puts no doubt on its name.
  bool is_usual = false;
  /// What is known of its parameters from elsewhere (a log shows the steps of its encoder). Where
  /// that much is large beside the noise, the search begins with it. Empty: nothing.
  Eigen::VectorXd expected;
  /// There is no second one at its place: what one more would explain is the first at another value
  /// of the scan (something creeps once, with one time constant).
  bool is_single = false;
  std::vector<EffectParameter> parameters;
  /// The size that is reported is the parameter itself where there is one, else
  /// sqrt(sum of weight x parameter^2), in `size_unit`.
  Eigen::VectorXd size_weights;
  /// Where that is no size: another function of the parameters, which may have a sign. Empty: the
  /// above.
  std::function<double(const Eigen::VectorXd& theta)> size;
  std::string size_unit;
  /// Parameters that can be: friction does not drive. Empty: all.
  std::function<bool(const Eigen::VectorXd& theta)> possible;
  /// As TraceOptions::floor, where the sensor errs by more in what this one touches; infinite: the
  /// recording cannot show it.
  double floor = 0.0;
  /// The same where it depends on the scan. Empty: it does not.
  std::function<double(double scan)> floor_at;
  /// The nonlinear parameter, searched: a period, a time, a width. Empty: none.
  std::vector<double> scan;
  bool scan_listed = false;  ///< only the listed values make sense; else those between them too
  double scan_step = 0.0;  ///< values between them are tried in such steps; 0: they are continuous
  /// The size of the effect is the value of its scan, by what it is: play is as wide as its gap.
  bool scan_is_size = false;
  std::string scan_name;
  std::string scan_unit;
  std::function<std::string(double scan)> scan_words;  ///< "joint2"; empty: the number says it
  /// Of a curve, the name of the covariate it is a smooth function of: it says no cause, only what
  /// repeats, and takes the place of a rest that was found there (`id.place`, this covariate). Its
  /// scan lists lengths over which it is smooth; it has as many parameters as that length asks for,
  /// each with a prior (AddedEffect::spread). Empty: no curve.
  std::string curve_over;
  [[nodiscard]] bool is_curve() const { return !curve_over.empty(); }
  /// One column a parameter, at a value of the scan (0 where there is none). Threads call it at the
  /// same time.
  std::function<std::vector<EffectColumn>(double scan)> columns;
};

/// What an unexplained rest may depend on.
struct Covariate {
  std::string name;  ///< "value of joint3", "direction of joint3", "time"
  std::string unit;
  Eigen::VectorXd value;  ///< instants
  /// Made of two others: no axis to draw a known effect over.
  bool is_product = false;
};

/// Where an unexplained rest may act.
struct RestPlace {
  std::string name;  ///< "joint3", "tag_12 across"
  std::string unit;  ///< of the carrier's factor
  int carrier = 0;
  /// rms in `unit` by which readings here are known to err from instant to instant; an error is
  /// theirs from the least to the most.
  double reading_error_least = 0.0;
  double reading_error_most = 0.0;
};

/// Where an unexplained rest may move rows by a vector that depends on a place of two coordinates,
/// which every row has of its own: an image.
struct RestField {
  std::string name;               ///< "camera"
  std::string unit;               ///< of the vector
  std::string covariate;          ///< "place in the image"
  std::string covariate_unit;     ///< of the place
  Eigen::MatrixX2d at;            ///< rows; NaN: this row has no place
  std::array<int, 2> carriers{};  ///< how rows answer to the vector's two components
  double floor = 0.0;             ///< in place of TraceOptions::floor
};

struct AddedEffect {
  EffectId id;
  double scan = 0.0;
  /// Of a curve: standard deviation of the prior on each of its parameters, beside whitened rows.
  double spread = 0.0;
  [[nodiscard]] bool operator==(const AddedEffect&) const = default;
};

/// A model fitted with some effects in it.
struct TracedFit {
  bool converged = false;
  std::string reason;  ///< where it did not
  Linearisation linear;
  std::vector<Eigen::VectorXd> values;  ///< of the added effects' parameters
  /// What the fitted model may still lack; effects that were added are among them and may be added
  /// again at another value of the scan (a second gear error, a second slip).
  std::vector<Candidate> candidates;
  std::vector<Covariate> covariates;
  std::vector<RestPlace> rest_places;
  std::vector<RestField> rest_fields;
  int clock = -1;  ///< carrier of the time of an instant; -1: instants have none
};

class TracedModel {
 public:
  virtual ~TracedModel() = default;
  /// Least squares over everything. Throws nothing for effects that `candidates` named.
  [[nodiscard]] virtual TracedFit fit(const std::vector<AddedEffect>& effects) const = 0;

 protected:
  TracedModel() = default;
  TracedModel(const TracedModel&) = default;
  TracedModel& operator=(const TracedModel&) = default;
};

}  // namespace kinescope
