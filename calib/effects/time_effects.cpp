// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <array>
#include <cmath>

#include <fmt/format.h>

#include "calib/effects/camera_effects.h"
#include "calib/effects/elsewhere.h"
#include "calib/effects/suspect.h"

namespace kinescope::effects {
namespace {

// What happens once leaves no trace too near to the ends.
constexpr double kFewestBefore = 0.06;  // of the recording
constexpr std::size_t kMostTimes = 120;
// A marker at rest repeats its corners' errors in every frame, until a bump gives it others.
constexpr double kRestingBias = 0.05;  // px

const std::vector<EffectParameter> kTwist{{"turn x", "rad"}, {"turn y", "rad"}, {"turn z", "rad"},
                                          {"shift x", "m"},  {"shift y", "m"},  {"shift z", "m"}};

// The six parameters of a twist of a part, with the same share.
std::vector<Correction> twists(const CameraEffect& like, CorrectedPart part, int index,
                               const Eigen::VectorXd& share) {
  std::vector<Correction> out;
  for (std::size_t i = 0; i < kTwist.size(); ++i) {
    Correction twist = correct(part, like, i, index);
    twist.direction = Vector6d::Unit(static_cast<Eigen::Index>(i));
    twist.share = share;
    out.push_back(std::move(twist));
  }
  return out;
}

// One recording's time.
struct Period {
  double first_s = 0.0;
  double last_s = 0.0;
  std::size_t frames = 0;

  // Where something that happens once is looked for.
  [[nodiscard]] double begin_s() const { return first_s + kFewestBefore * (last_s - first_s); }
  [[nodiscard]] double end_s() const { return last_s - kFewestBefore * (last_s - first_s); }
};

// One after the other; of one recording all of its time.
std::vector<Period> periods_of(const EffectWorld& world) {
  if (!world.of_recordings) return {{world.first_s, world.last_s, world.frames.times_s.size()}};
  std::vector<Period> out(world.cameras.size());
  for (std::size_t f = 0; f < world.frames.times_s.size(); ++f) {
    Period& own = out[static_cast<std::size_t>(world.camera_of_frame[f])];
    own.last_s = world.frames.times_s[f];
    if (own.frames++ == 0) own.first_s = own.last_s;
  }
  std::erase_if(out, [](const Period& period) { return period.frames == 0; });
  std::ranges::sort(out, {}, &Period::first_s);
  return out;
}

// Of every frame: 0 before a time, 1 from then on; of several recordings up to the end of the one
// that the time is in.
std::function<Eigen::VectorXd(double)> since(const EffectWorld& world) {
  return [periods = periods_of(world), time = frame_times(world),
          several = world.of_recordings](double at_s) -> Eigen::VectorXd {
    if (!several) return (time.array() >= at_s).cast<double>();
    const auto away = [at_s](const Period& p) {
      return std::max({p.begin_s() - at_s, at_s - p.end_s(), 0.0});
    };
    const Period& own = *std::ranges::min_element(periods, {}, away);
    const double from_s = std::clamp(at_s, own.begin_s(), own.end_s());
    return (time.array() >= from_s && time.array() <= own.last_s).cast<double>();
  };
}

// Where all that would tell of it rests from the time on (or until then), it is seen in one posture
// only, whose errors stay.
void told_in_one_posture(const EffectWorld& world, const std::vector<int>& movers, Candidate& c) {
  if (world.postures || world.kind != MeasurementKind::kCorners) return;
  c.floor_at = [moves = motion_span(world, movers)](double at_s) {
    return at_s > moves.low && at_s <= moves.high ? 0.0 : kRestingBias;
  };
}

// The time at which something happens once, as the value of the scan.
void happens_once(const EffectWorld& world, const std::vector<Period>& periods, Candidate& c) {
  c.scan.clear();
  c.scan_step = 0.0;
  for (const Period& period : periods) {
    const auto count = std::min<std::size_t>(kMostTimes / periods.size(), period.frames);
    for (std::size_t k = 0; k < count; ++k) {
      c.scan.push_back(period.begin_s() +
                       (period.end_s() - period.begin_s()) * static_cast<double>(k) /
                           static_cast<double>(std::max<std::size_t>(1, count - 1)));
    }
    // A step between two frames: any time between them says the same.
    c.scan_step =
        std::max(c.scan_step, (period.last_s - period.first_s) /
                                  static_cast<double>(std::max<std::size_t>(1, period.frames - 1)));
  }
  c.scan_name = "at";
  c.scan_unit = "s";
  if (world.postures) {
    // Their stamps may be any numbers.
    c.scan_words = [times_s = world.frames.times_s](double at_s) {
      const auto first = std::ranges::lower_bound(times_s, at_s);
      return fmt::format("posture {} of {}", first - times_s.begin() + 1, times_s.size());
    };
  }
}

// Of every frame: the way from the first (0) to the last (1) of what creeps towards rest.
Eigen::VectorXd creep(const Eigen::VectorXd& time, double constant) {
  const double last = std::expm1(-(time[time.size() - 1] - time[0]) / constant);
  return ((time[0] - time.array()) / constant).unaryExpr([last](double exponent) {
    return std::expm1(exponent) / last;
  });
}

// Stamps of postures may be any numbers: they are counted.
Eigen::VectorXd creeping_time(const EffectWorld& world) {
  if (!world.postures) return frame_times(world);
  const auto count = static_cast<Eigen::Index>(world.frames.times_s.size());
  return Eigen::VectorXd::LinSpaced(count, 0.0, static_cast<double>(count - 1));
}

// A time constant, as the value of the scan: from what is over early to a straight line.
void creeps(const EffectWorld& world, Candidate& c) {
  // Of the recording; the last is a straight line, but for a thousandth of it.
  constexpr std::array kConstants{0.1, 0.2, 0.4, 0.8, 1.6, 3.2, 100.0};
  constexpr double kHardlyBent = 3.2;
  const Eigen::VectorXd time = creeping_time(world);
  const double length = time[time.size() - 1] - time[0];
  for (const double constant : kConstants) c.scan.push_back(constant * length);
  c.scan_name = "time constant";
  c.scan_unit = world.postures ? "postures" : "s";
  c.is_single = true;
  // What is far from its end by then goes along a straight line.
  c.scan_words = [most = kHardlyBent * length, unit = c.scan_unit](double constant) {
    return constant > most ? fmt::format("more than {:.3g} {}", most, unit)
                           : fmt::format("{:.3g} {}", constant, unit);
  };
}

// Further than its own size, or half a radian, a marker does not slip: it is put elsewhere.
std::function<bool(const Eigen::VectorXd&)> is_a_slip(const EffectWorld& world, int marker) {
  constexpr double kMostTurn = 0.5;      // rad
  constexpr double kUnknownSize = 0.05;  // m
  const double size = world.tree.markers[static_cast<std::size_t>(marker)].size_m;
  return [most = size > 0.0 ? size : kUnknownSize](const Eigen::VectorXd& twist) {
    return twist.head<3>().norm() < kMostTurn && twist.tail<3>().norm() < most;
  };
}

CameraEffect tag_slip(const EffectWorld& world, int marker) {
  const std::string name = marker_name(world, marker);
  CameraEffect out =
      effect("tag_slip", name, fmt::format("{} moved on its link", name), kTwist, "m");
  out.candidate.size_weights.head<3>().setZero();
  out.candidate.size = [](const Eigen::VectorXd& twist) {
    return exp_pose(Vector6d(twist)).translation.norm();
  };
  out.candidate.check = "glue or screws of the marker's plate";
  out.candidate.record = "more frames with this marker in view, before and after";
  out.candidate.possible = is_a_slip(world, marker);
  if (rests(world, marker) && world.kind == MeasurementKind::kCorners)
    out.candidate.floor = kRestingBias;
  happens_once(world, periods_of(world), out.candidate);
  told_in_one_posture(world, movers_of(world, marker), out.candidate);
  out.corrections = [like = out, marker, share = since(world)](double at_s) {
    return twists(like, CorrectedPart::kMarker, marker, share(at_s));
  };
  return out;
}

CameraEffect camera_bump(const EffectWorld& world) {
  const bool on_robot = world.camera_link.value != 0;
  CameraEffect out = effect("camera_bump", "camera",
                            on_robot ? "the camera was moved on the link that carries it"
                                     : "the camera (or the robot's base) was moved",
                            kTwist, "rad");
  out.candidate.size_weights.tail<3>().setZero();
  out.candidate.check = on_robot ? "screws of the camera's bracket, cable pulls"
                                 : "tripod, cable pulls, screws of the base";
  out.candidate.record = "put a marker on the base, in view all the time";
  happens_once(world, periods_of(world), out.candidate);
  told_in_one_posture(world, world.moving, out.candidate);
  out.corrections = [like = out, share = since(world)](double at_s) {
    return twists(like, CorrectedPart::kCamera, 0, share(at_s));
  };
  return out;
}

CameraEffect camera_drift(const EffectWorld& world) {
  CameraEffect out =
      effect("camera_drift", "camera",
             world.camera_link.value != 0 ? "the camera moves slowly on the link that carries it"
                                          : "the camera (or the robot's base) moves slowly",
             kTwist, "rad");
  out.candidate.size_weights.tail<3>().setZero();
  out.candidate.check = "tripod head that settles, camera and mount that warm up";
  out.candidate.record = "let the camera warm up; put a marker on the base, in view all the time";
  creeps(world, out.candidate);
  out.corrections = [like = out, time = creeping_time(world)](double constant) {
    return twists(like, CorrectedPart::kCamera, 0, creep(time, constant));
  };
  return out;
}

// The focal length over the one at first: a lens that moves to focus (or zooms) takes the image's
// centre along a little.
std::function<std::vector<Correction>(double)> another_focus(
    const CameraEffect& like, std::function<Eigen::VectorXd(double)> share) {
  return [like, share = std::move(share)](double scan) {
    Correction focal = correct(CorrectedPart::kFocalLength, like, 0);
    focal.share = share(scan);
    return std::vector{focal};
  };
}

std::function<std::vector<Correction>(double)> centre_with_focus(
    const CameraEffect& like, std::function<Eigen::VectorXd(double)> share) {
  constexpr double kMostShift = 1.0;  // px; chosen
  return [like, share = std::move(share)](double scan) {
    std::vector<Correction> out;
    for (int axis = 0; axis < 2; ++axis) {
      Correction shift = correct(CorrectedPart::kIntrinsic, like, 0, kFirstOfCentre + axis);
      shift.name = fmt::format("{} centre beside {} {}", like.candidate.id.place,
                               like.candidate.id.effect, "xy"[axis]);
      shift.unit = "px";
      shift.share = share(scan);
      shift.is_nuisance = true;
      shift.prior_sigma = kMostShift;
      out.push_back(std::move(shift));
    }
    return out;
  };
}

constexpr std::string_view kFocusCheck =
    "autofocus and zoom of the camera: switch both off; a lens that warms up or comes loose";

CameraEffect focal_jump(const EffectWorld& world) {
  CameraEffect out =
      effect("focal_jump", "camera", "the focal length jumped (the camera focused anew, or zoomed)",
             {{"relative change", ""}}, "");
  out.candidate.check = kFocusCheck;
  out.candidate.record = "fix the focus; bring the markers nearer to the camera and farther away";
  happens_once(world, periods_of(world), out.candidate);
  told_in_one_posture(world, world.moving, out.candidate);
  out.corrections = another_focus(out, since(world));
  out.nuisances = centre_with_focus(out, since(world));
  return out;
}

CameraEffect focal_drift(const EffectWorld& world) {
  CameraEffect out =
      effect("focal_drift", "camera",
             "the focal length changes slowly (focus that creeps, a lens that warms up)",
             {{"relative change", ""}}, "");
  out.candidate.check = kFocusCheck;
  out.candidate.record = "fix the focus, and let the camera warm up";
  creeps(world, out.candidate);
  const auto share = [time = creeping_time(world)](double constant) {
    return creep(time, constant);
  };
  out.corrections = another_focus(out, share);
  out.nuisances = centre_with_focus(out, share);
  return out;
}

// Of one camera beside others, which would see the base move, too.
CameraEffect without_base(CameraEffect of) {
  constexpr std::string_view kBase = " (or the robot's base)";
  const std::size_t at = of.candidate.words.find(kBase);
  if (at != std::string::npos) of.candidate.words.erase(at, kBase.size());
  return of;
}

// Each recording's camera, or the base before it, moved once.
std::vector<CameraEffect> bumps_in_recordings(const EffectWorld& world) {
  const std::vector<double>& times_s = world.frames.times_s;
  std::vector<CameraEffect> out;
  for (std::size_t c = 0; c < world.cameras.size(); ++c) {
    std::vector<Period> own = periods_of(world);
    const auto first = std::ranges::find(world.camera_of_frame, static_cast<int>(c));
    if (first == world.camera_of_frame.end()) continue;
    const double first_s = times_s[static_cast<std::size_t>(first - world.camera_of_frame.begin())];
    std::erase_if(own, [&](const Period& period) { return period.first_s != first_s; });
    CameraEffect bump = at_camera(world, c, camera_bump(world));
    happens_once(world, own, bump.candidate);
    out.push_back(std::move(bump));
  }
  return out;
}

// Links, screws and racks of one temperature: every length grows alike.
CameraEffect thermal_growth(const EffectWorld& world) {
  CameraEffect out = effect("thermal_growth", "robot", "the robot grows (or shrinks) slowly",
                            {{"relative growth", "m/m"}}, "m/m");
  out.candidate.signed_words = {"the robot grows slowly", "the robot shrinks slowly"};
  out.candidate.check =
      "temperature of the links: aluminium grows by 0.023 mm/m a kelvin, steel by 0.012 mm/m";
  out.candidate.record = "let the robot warm up first, or log its temperature";
  out.candidate.possible = [](const Eigen::VectorXd& growth) {
    constexpr double kHottest = 0.02;  // plastic over 200 K
    return std::abs(growth[0]) < kHottest;
  };
  creeps(world, out.candidate);
  out.corrections = [like = out, time = creeping_time(world)](double constant) {
    Correction growth = correct(CorrectedPart::kGrowth, like, 0);
    growth.share = creep(time, constant);
    return std::vector{growth};
  };
  out.nuisances = [like = out, time = creeping_time(world)](double constant) {
    return held_elsewhere(like, creep(time, constant));
  };
  return out;
}

CameraEffect clock_jump(const EffectWorld& world) {
  CameraEffect out = effect("clock_jump", "clock", "one of the clocks jumped, or frames were lost",
                            {{"jump", "s"}}, "s");
  // Before anything moves it is an offset from the start.
  out.candidate.contains = {{"time_offset", "clock"}};
  out.candidate.check = "frames that the recorder dropped or doubled, clock that was set meanwhile";
  out.candidate.record = "stamps of the exposures in place of a frame rate; move all the time";
  happens_once(world, periods_of(world), out.candidate);
  out.corrections = [like = out, share = since(world)](double at_s) {
    Correction jump = correct(CorrectedPart::kClock, like, 0);
    jump.share = share(at_s);
    return std::vector{jump};
  };
  return out;
}

CameraEffect zero_jump(const EffectWorld& world, const Suspect& s) {
  CameraEffect out = effect(s, "zero_jump", fmt::format("the zero of {} jumped", s.name),
                            {{"jump", s.unit}}, s.unit);
  out.candidate.check =
      "steps that the motor lost, teeth that a belt jumped, set screws, counts that an encoder "
      "lost";
  out.candidate.record = fmt::format("go to the reference of {} before and after", s.name);
  happens_once(world, periods_of(world), out.candidate);
  told_in_one_posture(world, world.moving, out.candidate);
  out.corrections = [s, share = since(world)](double at_s) {
    return std::vector{turn(s, "zero jump", s.unit, share(at_s))};
  };
  return out;
}

CameraEffect zero_drift(const EffectWorld& world, const Suspect& s) {
  CameraEffect out = effect(s, "zero_drift", fmt::format("the zero of {} moves slowly", s.name),
                            {{"drift", s.unit}}, s.unit);
  out.candidate.check = "warm-up of drive and link, set screws, belt that creeps";
  out.candidate.record = fmt::format("go to the same place of {} from time to time", s.name);
  creeps(world, out.candidate);
  out.corrections = [s, time = creeping_time(world)](double constant) {
    return std::vector{turn(s, "zero drift", s.unit, creep(time, constant))};
  };
  return out;
}

}  // namespace

std::vector<CameraEffect> time_effects(const EffectWorld& world) {
  std::vector<CameraEffect> out;
  for (const int marker : world.seen) out.push_back(tag_slip(world, marker));
  if (world.of_recordings) {
    // What creeps does so in a recording, not from one to the next: it is looked for in each alone.
    for (CameraEffect& bump : bumps_in_recordings(world)) out.push_back(std::move(bump));
  } else if (!world.is_carried) {
    // Of several cameras all alike: it is the robot's base that moves.
    for (const CameraEffect& moved : {camera_bump(world), camera_drift(world)}) {
      out.push_back(moved);
      for (std::size_t c = 0; world.cameras.size() > 1 && c < world.cameras.size(); ++c)
        out.push_back(at_camera(world, c, without_base(moved)));
    }
  }
  if (!world.of_recordings && world.kind == MeasurementKind::kCorners) {
    for (std::size_t c = 0; c < world.cameras.size(); ++c) {
      for (const CameraEffect& focal : {focal_jump(world), focal_drift(world)})
        out.push_back(at_camera(world, c, focal));
    }
  }
  if (!world.of_recordings && world.camera_link.value == 0) out.push_back(thermal_growth(world));
  if (!world.postures) out.push_back(clock_jump(world));
  for (const int joint : world.driven) {
    const Suspect s = suspect(world, joint);
    out.push_back(zero_jump(world, s));
    if (!world.of_recordings) out.push_back(zero_drift(world, s));
  }
  return out;
}

}  // namespace kinescope::effects
