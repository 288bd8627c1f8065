#include "signal/steps.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "base/error.hpp"
#include "base/random.hpp"
#include "base/words.hpp"

namespace ulna {
namespace {

constexpr double kMostSamples = 1e8;

struct SampleRange {
  Index low = 0;
  Index high = 0;

  Index draw(Random& random) const noexcept {
    return low + static_cast<Index>(random.below(high - low + 1));
  }
};

// Longer than this is no design, and its samples do not fit a whole number.
void check_span(double seconds, double rate_hz, const char* argument, const char* what) {
  require(seconds * rate_hz <= kMostSamples, argument,
          std::string(what) + " is longer than 1e8 samples: give seconds");
}

SampleRange samples(double low_s, double high_s, double rate_hz, const char* argument,
                    const char* what) {
  require(std::isfinite(low_s) && std::isfinite(high_s) && low_s >= 0.0 && high_s >= low_s,
          argument, std::string(what) + " must be a range of seconds, the smaller one first");
  check_span(high_s, rate_hz, argument, what);
  const SampleRange range{static_cast<Index>(std::ceil(low_s * rate_hz - 1e-6)),
                          static_cast<Index>(std::floor(high_s * rate_hz + 1e-6))};
  require(range.low <= range.high, argument,
          std::string(what) + " holds no whole sample: widen it or raise the rate");
  return range;
}

Matrix directions_of(const StepsSpec& spec) {
  if (spec.vectors.size() > 0) {
    check_axes(spec.vectors.cols());
    for (Index d = 0; d < spec.vectors.rows(); ++d) {
      require(std::abs(spec.vectors.row(d).norm() - 1.0) < 1e-6, "directions",
              "direction " + std::to_string(d) + " must be a vector of length 1");
    }
    return spec.vectors;
  }
  check_axes(spec.axes);
  require(spec.axes <= 2, "directions",
          "for more than two axes give the directions themselves, a row each");
  if (spec.axes == 1) {
    require(spec.directions == 1 || spec.directions == 2, "directions",
            "one axis has 1 or 2 directions");
    return Matrix{{1.0}, {-1.0}}.topRows(spec.directions);
  }
  require(spec.directions >= 1 && spec.directions <= 360, "directions",
          "there must be from 1 to 360 directions");
  Matrix out(spec.directions, 2);
  for (Index d = 0; d < spec.directions; ++d) {
    const double angle = 2.0 * kPi * static_cast<double>(d) / static_cast<double>(spec.directions);
    out.row(d) << std::cos(angle), std::sin(angle);
  }
  // A quarter turn is exact: no step along y moves x by a rounding.
  return (out.array().abs() < 1e-15).select(0.0, out);
}

void check(const StepsSpec& spec) {
  check_rate(spec.rate_hz);
  check_second_order(spec.filter);
  require(std::isfinite(spec.size) && spec.size > 0.0, "size",
          "the size of a step must be a positive number");
  require(spec.repeats >= 1 && spec.repeats <= 1000, "repeats",
          "every direction comes from 1 to 1000 times");
  require(std::isfinite(spec.return_s) && spec.return_s > 0.0, "return_s",
          "the way back must take a positive number of seconds");
  require(std::isfinite(spec.rest_s) && spec.rest_s >= 0.0, "rest_s",
          "the rest at the end must last 0 s or longer");
  check_span(spec.return_s, spec.rate_hz, "return_s", "the way back");
  check_span(spec.rest_s, spec.rate_hz, "rest_s", "the rest at the end");
  require(spec.wait_low_s >= spec.return_s, "wait_s",
          sentence(6, "the way back takes ", spec.return_s, " s and the next step may come ",
                   spec.wait_low_s, " s after the hold: wait at least as long as the way back"));
}

// Every direction once in each round, shuffled within it.
std::vector<Index> order_of(Index directions, Index repeats, Random& random) {
  std::vector<Index> order;
  std::vector<Index> round(static_cast<std::size_t>(directions));
  for (Index r = 0; r < repeats; ++r) {
    std::iota(round.begin(), round.end(), Index{0});
    for (std::size_t i = round.size(); i > 1; --i) {
      std::swap(round[i - 1],
                round[static_cast<std::size_t>(random.below(static_cast<std::int64_t>(i)))]);
    }
    order.insert(order.end(), round.begin(), round.end());
  }
  return order;
}

void put(Excitation& out, Index row, const Vector& direction, const SignalPoint& p) {
  out.value.row(row) += p.value * direction.transpose();
  out.rate.row(row) += p.rate * direction.transpose();
  out.acceleration.row(row) += p.acceleration * direction.transpose();
}

}  // namespace

Excitation steps(const StepsSpec& spec, Token* token) {
  check(spec);
  const Matrix directions = directions_of(spec);
  const double rate = spec.rate_hz;
  const SampleRange hold = samples(spec.hold_low_s, spec.hold_high_s, rate, "hold_s", "the hold");
  require(hold.low >= 2, "hold_s", "a hold must last at least two samples");
  const SampleRange wait =
      samples(spec.wait_low_s, spec.wait_high_s, rate, "wait_s", "the wait before a step");
  const Index back = static_cast<Index>(std::floor(spec.return_s * rate + 1e-6));
  const Index rest = static_cast<Index>(std::ceil(spec.rest_s * rate - 1e-6));

  Random random(spec.seed);
  const std::vector<Index> order = order_of(directions.rows(), spec.repeats, random);
  Excitation out;
  out.drive = spec.drive;
  out.rate_hz = rate;
  Index row = 0;
  for (const Index d : order) {
    const Index onset = row + wait.draw(random);
    const Index end = onset + hold.draw(random);
    out.segments.push_back({onset, end});
    out.events.push_back({static_cast<double>(onset) / rate,
                          static_cast<double>(end - onset) / rate, d,
                          spec.size * directions.row(d).transpose()});
    row = end;
    rows_of(static_cast<double>(row + 2) / rate, rate, "repeats");  // refuses what is too long
  }
  const Index rows = rows_of(static_cast<double>(row + back + rest + 1) / rate, rate, "repeats");
  out.value = out.rate = out.acceleration = Matrix::Zero(rows, directions.cols());
  for (std::size_t i = 0; i < out.events.size(); ++i) {
    step(token, static_cast<double>(i) / static_cast<double>(out.events.size()));
    const auto [onset, end] = out.segments[i];
    const Vector& size = out.events[i].size;
    for (Index r = onset; r < end; ++r) {
      put(out, r, size, step_response(spec.filter, static_cast<double>(r - onset) / rate));
    }
    const SignalPoint from = step_response(spec.filter, static_cast<double>(end - onset) / rate);
    for (Index r = end; r <= end + back; ++r) {
      put(out, r, size,
          gently_back(from, spec.return_s,
                      std::min(spec.return_s, static_cast<double>(r - end) / rate)));
    }
  }

  const StepFacts facts = step_facts(spec.filter);
  if (facts.overshoot > 0.0) {
    out.notes.push_back(sentence(4, "A step overshoots by ", 100.0 * facts.overshoot, " %, ",
                                 facts.peak_time_s, " s after its onset: the largest reference is ",
                                 spec.size * (1.0 + facts.overshoot), "."));
  }
  if (facts.settling_s > spec.hold_low_s) {
    out.notes.push_back(sentence(3, "The filter settles to 2 % in ", facts.settling_s,
                                 " s, longer than the hold of ", spec.hold_low_s, " to ",
                                 spec.hold_high_s,
                                 " s: the reference still swings when the way back begins."));
  }
  out.provenance = sentence(
      9, "design: ", out.events.size(), " steps of ", spec.size, " in ", directions.rows(),
      " directions through zeta ", spec.filter.damping_ratio, ", ", spec.filter.natural_rad_s,
      " rad/s, seed ", spec.seed, ", ", out.duration_s(), " s at ", rate, " Hz");
  return out;
}

}  // namespace ulna
