#include "record/look.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <sstream>

namespace ulna {
namespace {

constexpr Index kFewRows = 100;   // below, no window of a smoother and no interval means anything
constexpr double kGap = 1.5;      // of the median step: one sample is missing
constexpr double kJitter = 0.01;  // of the median step
constexpr double kClippedJump =
    2.5;  // quanta; a slow quantised signal enters its turning point by one
constexpr std::size_t kFewLevels = 16;  // a switch or a staircase sits on its extremes by right

std::string text_of(double value) {
  std::ostringstream out;
  out.precision(4);
  out << value;
  return out.str();
}

class Looker {
 public:
  Looker(const Record& record, Token* token) : record_(record), token_(token) {}

  std::vector<Finding> run() {
    look_at_clock();
    for (Index c = 0; c < record_.channel_count(); ++c) {
      step(token_,
           0.9 + 0.1 * static_cast<double>(c) / static_cast<double>(record_.channel_count()));
      look_at_channel(c);
    }
    return std::move(out_);
  }

 private:
  void add(Severity severity, const char* code, const std::string& channel, Index row, Index count,
           const std::string& message) {
    out_.push_back({severity, code, channel, row, count, message});
  }

  double time(Index row) const { return record_.time()[static_cast<std::size_t>(row)]; }

  void look_at_clock() {
    if (record_.rows() < kFewRows) {
      add(Severity::kError, "short", "", 0, record_.rows(),
          "the record has only " + std::to_string(record_.rows()) +
              " samples: an analysis needs some seconds of recording");
    }
    const double rate = record_.rate_hz();
    if (rate < 50.0 || rate > 50000.0) {
      add(Severity::kWarning, "rate", "", 0, 0,
          "the sample rate is " + text_of(rate) +
              " Hz: check the unit of the time (s or ms), 100 to 10000 Hz are usual");
    }
    std::vector<double> steps;
    for (const Trial& trial : record_.trials()) {
      for (Index i = trial.begin + 1; i < trial.end; ++i) steps.push_back(time(i) - time(i - 1));
    }
    if (steps.size() < 2) return;
    const auto middle = steps.begin() + static_cast<std::ptrdiff_t>(steps.size() / 2);
    std::nth_element(steps.begin(), middle, steps.end());
    const double median = *middle;
    Index gaps = 0, first_gap = 0, worst = 0, counted = 0;
    double longest = 0.0, largest = 0.0, squares = 0.0;
    for (const Trial& trial : record_.trials()) {
      for (Index i = trial.begin + 1; i < trial.end; ++i) {
        const double dt = time(i) - time(i - 1);
        if (dt > kGap * median) {
          if (gaps++ == 0) first_gap = i;
          longest = std::max(longest, dt);
          continue;
        }
        const double off = std::abs(dt / median - 1.0);
        squares += off * off;
        ++counted;
        if (off > largest) {
          largest = off;
          worst = i;
        }
      }
    }
    if (gaps > 0) {
      add(Severity::kError, "gap", "", first_gap, gaps,
          std::to_string(gaps) + (gaps == 1 ? " gap" : " gaps") +
              " in the clock, the first before row " + std::to_string(first_gap) + " (" +
              text_of(time(first_gap)) + " s), the longest " + text_of(longest) +
              " s: split the record there");
    }
    if (largest > kJitter) {
      add(Severity::kWarning, "jitter", "", worst, counted,
          "the time stamps jitter by " +
              text_of(100.0 * std::sqrt(squares / static_cast<double>(counted))) +
              " % rms of a step, at most " + text_of(100.0 * largest) + " % at row " +
              std::to_string(worst) + ": regularise the record before a filter is used");
    }
  }

  void look_at_channel(Index c) {
    const Channel& channel = record_.channels()[static_cast<std::size_t>(c)];
    const double* y = record_.values().data() + c * record_.rows();
    const bool used = channel.role != Role::kOther;
    const std::string name = "channel \"" + channel.name + "\"";
    double low = std::numeric_limits<double>::infinity(), high = -low;
    Index missing = 0, first_missing = 0, runs = 0, finite = 0;
    for (const Trial& trial : record_.trials()) {
      for (Index i = trial.begin; i < trial.end; ++i) {
        if (std::isfinite(y[i])) {
          low = std::min(low, y[i]);
          high = std::max(high, y[i]);
          ++finite;
          continue;
        }
        if (missing++ == 0) first_missing = i;
        runs += i == trial.begin || std::isfinite(y[i - 1]) ? 1 : 0;
      }
    }
    if (missing > 0) {
      add(used ? Severity::kError : Severity::kNote, "nan", channel.name, first_missing, missing,
          name + " has " + std::to_string(missing) + " missing values in " + std::to_string(runs) +
              (runs == 1 ? " run" : " runs") + ", the first at row " +
              std::to_string(first_missing) +
              (used ? ": split the record there" : ": mind them when you use it"));
    }
    if (finite == 0) return;
    if (low == high) {
      look_at_constant(channel, name, low);
      return;
    }
    if (!used) return;
    const double quantum = smallest_step(y);
    if (channel.role != Role::kReference) look_for_clipping(channel, name, y, low, high, quantum);
    look_at_quanta(channel, name, y, quantum, high - low);
    look_at_unit(channel, name, low, high);
  }

  void look_at_constant(const Channel& channel, const std::string& name, double value) {
    const bool needed = channel.role == Role::kPosition || channel.role == Role::kForce;
    if (channel.role == Role::kForce && value == 0.0) {
      add(Severity::kError, "zero", channel.name, 0, record_.rows(),
          name + " is zero throughout: check that the sensor was connected and recorded");
      return;
    }
    const Severity severity = needed                             ? Severity::kError
                              : channel.role == Role::kReference ? Severity::kWarning
                                                                 : Severity::kNote;
    add(severity, "constant", channel.name, 0, record_.rows(),
        name + " is constant at " + text_of(value) +
            (needed ? ": nothing can be identified from it; check that it was recorded" : ""));
  }

  double smallest_step(const double* y) const {
    double least = std::numeric_limits<double>::infinity();
    for (const Trial& trial : record_.trials()) {
      for (Index i = trial.begin + 1; i < trial.end; ++i) {
        const double d = std::abs(y[i] - y[i - 1]);
        if (d > 0.0 && d < least) least = d;
      }
    }
    return least;
  }

  bool few_levels(const double* y) const {
    std::vector<double> levels;
    for (Index i = 0; i < record_.rows(); ++i) {
      if (!std::isfinite(y[i]) || std::find(levels.begin(), levels.end(), y[i]) != levels.end())
        continue;
      levels.push_back(y[i]);
      if (levels.size() > kFewLevels) return false;
    }
    return true;
  }

  void look_for_clipping(const Channel& channel, const std::string& name, const double* y,
                         double low, double high, double quantum) {
    Index runs = 0, longest = 0, total = 0, first = -1;
    for (const Trial& trial : record_.trials()) {
      for (Index i = trial.begin; i < trial.end;) {
        if (y[i] != low && y[i] != high) {
          ++i;
          continue;
        }
        Index end = i + 1;
        while (end < trial.end && y[end] == y[i]) ++end;
        // Rest before the first and after the last motion is no clipping.
        const bool inside = i > trial.begin && end < trial.end;
        if (inside && end - i >= 3) {
          const double jump = std::max(std::abs(y[i] - y[i - 1]), std::abs(y[end] - y[end - 1]));
          if (jump > kClippedJump * quantum) {
            if (first < 0) first = i;
            ++runs;
            total += end - i;
            longest = std::max(longest, end - i);
          }
        }
        i = end;
      }
    }
    if ((runs < 2 && longest < 5) || few_levels(y)) return;
    add(Severity::kWarning, "saturated", channel.name, first, total,
        name + " stays at its extreme value for " + std::to_string(total) + " samples in " +
            std::to_string(runs) + (runs == 1 ? " run" : " runs") + ", the first at row " +
            std::to_string(first) + ": the sensor was probably saturated; leave those parts out");
  }

  void look_at_quanta(const Channel& channel, const std::string& name, const double* y,
                      double quantum, double range) {
    if (!(quantum > 0.002 * range) || record_.rows() < kFewRows) return;
    for (Index i = 1; i < record_.rows(); ++i) {
      const double ratio = (y[i] - y[i - 1]) / quantum;
      if (std::isfinite(ratio) && std::abs(ratio - std::round(ratio)) > 0.01) return;
    }
    add(Severity::kNote, "quantised", channel.name, 0, record_.rows(),
        name + " comes in steps of " + text_of(quantum) + " " + channel.unit + ", " +
            text_of(100.0 * quantum / range) + " % of its range: its noise is at least " +
            text_of(quantum / std::sqrt(12.0)) + " " + channel.unit + " rms");
  }

  void look_at_unit(const Channel& channel, const std::string& name, double low, double high) {
    const double range = high - low;
    const double most = std::max(std::abs(low), std::abs(high));
    std::string suspicion;
    const bool motion = channel.role == Role::kPosition || channel.role == Role::kReference;
    if (motion && channel.unit == "m" && range > 1.5) {
      suspicion = "more than an arm can reach; is it in mm or in an angle's unit?";
    } else if (motion && channel.unit == "m" && range < 1e-5) {
      suspicion = "less than a perturbation; is its unit really \"" + channel.source_unit + "\"?";
    } else if (motion && channel.unit == "rad" && (range > 3.5 || most > 7.0)) {
      suspicion = "more than a joint can turn; is it in degrees?";
    } else if (motion && channel.unit == "rad" && range < 2e-3) {
      suspicion = "less than a perturbation; is its unit really \"" + channel.source_unit + "\"?";
    } else if (channel.role == Role::kForce && channel.unit == "N" && most > 5000.0) {
      suspicion = "more than an arm can exert; is it in mN?";
    } else if (channel.role == Role::kForce && channel.unit == "N" && range < 5e-3) {
      suspicion = "less than a force sensor resolves; is it in kN?";
    } else if (channel.role == Role::kForce && channel.unit == "Nm" && most > 500.0) {
      suspicion = "more than a joint can exert; is it in Nmm?";
    } else if (channel.role == Role::kForce && channel.unit == "Nm" && range < 1e-4) {
      suspicion = "less than a torque sensor resolves; is its unit right?";
    }
    if (suspicion.empty()) return;
    add(Severity::kWarning, "unit", channel.name, 0, 0,
        name + " spans " + text_of(range) + " " + channel.unit + ", " + suspicion +
            " Set the unit in a map if so.");
  }

  const Record& record_;
  Token* token_;
  std::vector<Finding> out_;
};

}  // namespace

std::vector<Finding> look(const Record& record, Token* token) {
  return Looker(record, token).run();
}

}  // namespace ulna
