#include "ident/order_search.hpp"

#include <algorithm>
#include <cmath>

#include "base/error.hpp"
#include "base/pool.hpp"
#include "base/words.hpp"

namespace ulna {
namespace {

// Standard errors by which another model must be worse to be left out. One would be too few: the
// least error is picked among many, and of models that hold the truth one is best by chance.
constexpr double kWorse = 2.0;

// On the rows that the models were estimated from, superfluous coefficients take about chi-squared
// from the sum of squares, which is sqrt(chi-squared) / 2 standard errors: two for the best of some
// dozens of models.
constexpr double kWorseInside = 3.0;

// Percent accounted for, above which what is left is rounding and compares with nothing.
constexpr double kExact = 100.0 - 1e-9;

constexpr Index kLargestOrder = 10;
constexpr std::size_t kMostCandidates = 100'000;
constexpr Index kBlocks = 20;  // of rows; errors of neighbours are correlated

std::string name_of(const OrderCandidate& c) {
  return sentence(6, c.poles, c.poles == 1 ? " pole, " : " poles, ", c.zeros,
                  c.zeros == 1 ? " zero" : " zeros",
                  c.delay_s > 0.0 ? sentence(4, " and a delay of ", 1e3 * c.delay_s, " ms") : "");
}

Index size_of(const OrderCandidate& c) { return c.fit.setup.orders.parameters(); }

double held_out_error(const OrderCandidate& c) {
  double sum = 0.0;
  Index count = 0;
  for (const double e : c.fit.validation_error) {
    if (std::isnan(e)) continue;
    sum += e * e;
    ++count;
  }
  return count > 0 ? sum / static_cast<double>(count) : kInfinity;
}

// Whether the mean difference of squared errors is within `limit` standard errors of it, which come
// from blocks of rows.
bool as_good_as(const Vector& worse, const Vector& best, double limit) {
  std::vector<double> rows;
  for (Index k = 0; k < best.size(); ++k) {
    const double a = worse[k];
    const double b = best[k];
    if (!std::isnan(a) && !std::isnan(b)) rows.push_back(a * a - b * b);
  }
  const Index blocks = std::min<Index>(kBlocks, static_cast<Index>(rows.size()));
  Vector means(blocks);
  for (Index b = 0; b < blocks; ++b) {
    const std::size_t first =
        rows.size() * static_cast<std::size_t>(b) / static_cast<std::size_t>(blocks);
    const std::size_t last =
        rows.size() * static_cast<std::size_t>(b + 1) / static_cast<std::size_t>(blocks);
    double sum = 0.0;
    for (std::size_t k = first; k < last; ++k) sum += rows[k];
    means[b] = sum / static_cast<double>(last - first);
  }
  const double n = static_cast<double>(blocks);
  const double mean = means.mean();
  const double variance = (means.array() - mean).square().sum() / std::max(1.0, n - 1.0);
  return mean <= limit * std::sqrt(variance / n);
}

double value_of(const OrderCandidate& c, OrderCriterion criterion) {
  if (c.failed) return kInfinity;
  double value = 0.0;
  switch (criterion) {
    case OrderCriterion::kHeldOut:
      value = held_out_error(c);
      break;
    case OrderCriterion::kBic:
      value = c.fit.bic;
      break;
    case OrderCriterion::kAicc:
      value = c.fit.aicc;
      break;
    case OrderCriterion::kYic:
      value = c.fit.yic;
      break;
  }
  return std::isnan(value) ? kInfinity : value;
}

const char* word_of(OrderCriterion criterion) {
  switch (criterion) {
    case OrderCriterion::kHeldOut:
      return "held-out error";
    case OrderCriterion::kBic:
      return "BIC";
    case OrderCriterion::kAicc:
      return "AICc";
    case OrderCriterion::kYic:
      break;
  }
  return "YIC";
}

void recommend(OrderSearch& search, OrderCriterion criterion) {
  const auto& all = search.candidates;
  const auto usable = [](const OrderCandidate& c) { return c.note.empty(); };
  const OrderCandidate* closest = nullptr;
  for (const OrderCandidate& c : all) {
    const bool closer = closest == nullptr || c.fit.noise_variance < closest->fit.noise_variance;
    if (usable(c) && closer) closest = &c;
  }
  for (std::size_t i = 0; i < all.size(); ++i) {
    if (!usable(all[i])) continue;
    const bool near = criterion != OrderCriterion::kYic || all[i].fit.vaf > kExact ||
                      as_good_as(all[i].fit.output_error, closest->fit.output_error, kWorseInside);
    if (!near) continue;
    search.recommended = static_cast<Index>(i);
    break;
  }
  if (search.recommended < 0) {
    search.reason =
        "none of the models is good: see the notes of the candidates, and try other orders, delays "
        "or more data";
    return;
  }
  const OrderCandidate& best = all[static_cast<std::size_t>(search.recommended)];
  if (criterion != OrderCriterion::kHeldOut) {
    search.reason =
        sentence(6, name_of(best), ": the least ", word_of(criterion),
                 criterion == OrderCriterion::kYic
                     ? " among the models whose error is within three standard errors of the least"
                     : " of the models that converged to a stable, determined estimate");
    return;
  }
  std::size_t chosen = static_cast<std::size_t>(search.recommended);
  for (std::size_t i = 0; i < all.size(); ++i) {
    if (!usable(all[i]) || size_of(all[i]) >= size_of(all[chosen])) continue;
    // Sorted: the better one of a size comes first.
    if (all[i].fit.vaf_held_out > kExact ||
        as_good_as(all[i].fit.validation_error, best.fit.validation_error, kWorse)) {
      chosen = i;
    }
  }
  search.recommended = static_cast<Index>(chosen);
  const OrderCandidate& c = all[chosen];
  if (&c == &best) {
    search.reason =
        sentence(4, name_of(c), ": the least error on held-out rows (VAF ", c.fit.vaf_held_out,
                 " %), and every smaller model is significantly worse");
  } else {
    search.reason =
        sentence(4, name_of(c), ": the fewest coefficients whose error on held-out rows (VAF ",
                 c.fit.vaf_held_out, " %) is within two standard errors of the least (",
                 best.fit.vaf_held_out, " %, ", name_of(best), ")");
  }
}

const char* complaint(FitOutcome outcome) {
  switch (outcome) {
    case FitOutcome::kGood:
      break;
    case FitOutcome::kNotConverged:
      return "not converged";
    case FitOutcome::kUnstable:
      return "unstable";
    case FitOutcome::kIllConditioned:
      return "not determined by the data";
    case FitOutcome::kUnexplained:
      return "explains nothing";
  }
  return "";
}

}  // namespace

OrderSearch search_orders(MatrixRef inputs, VectorRef output, double rate_hz,
                          const std::vector<RowRange>& ranges, const OrderGrid& grid,
                          OrderCriterion criterion, RationalOptions options, int threads,
                          Token* token) {
  require(!grid.poles.empty(), "poles", "poles must name at least one number");
  require(!grid.delay_s.empty(), "delay_s", "delay_s must name at least one delay");
  require(options.lower.size() == 0 && options.upper.size() == 0, "bounds",
          "bounds belong to one order and cannot be given to a search");
  options.refit = false;
  if (criterion == OrderCriterion::kHeldOut && options.setup.held_out == 0.0) {
    options.setup.held_out = 0.25;
  }
  // Models with other delays must not be judged by other rows.
  options.setup.least_skip_s = std::max(
      options.setup.least_skip_s, *std::max_element(grid.delay_s.begin(), grid.delay_s.end()));

  for (const Index n : grid.poles) {
    require(n >= 1 && n <= kLargestOrder, "poles", "a number of poles must be from 1 to 10");
  }
  require(
      grid.poles.size() * (grid.zeros.empty() ? std::size_t{kLargestOrder} : grid.zeros.size()) <=
          kMostCandidates / grid.delay_s.size(),
      "delay_s", "more than 100000 models are asked for: try fewer delays");
  OrderSearch search;
  for (const Index n : grid.poles) {
    std::vector<Index> zeros = grid.zeros;
    if (zeros.empty()) {
      for (Index m = 0; m < n; ++m) zeros.push_back(m);
    }
    for (const Index m : zeros) {
      if (m > n) continue;
      for (const double delay : grid.delay_s) {
        OrderCandidate candidate;
        candidate.poles = n;
        candidate.zeros = m;
        candidate.delay_s = delay;
        search.candidates.push_back(std::move(candidate));
      }
    }
  }
  require(!search.candidates.empty(), "zeros",
          "every number of zeros exceeds every number of poles");

  const auto inputs_count = static_cast<std::size_t>(inputs.cols());
  parallel_for(
      static_cast<std::ptrdiff_t>(search.candidates.size()), threads,
      [&](std::ptrdiff_t index) {
        OrderCandidate& c = search.candidates[static_cast<std::size_t>(index)];
        RationalOptions own = options;
        own.setup.orders.poles = c.poles;
        own.setup.orders.zeros.assign(inputs_count, c.zeros);
        own.setup.orders.delay_s.assign(inputs_count, c.delay_s);
        Token part(token);
        try {
          c.fit = identify_rational(inputs, output, rate_hz, ranges, own, &part);
          c.note = complaint(c.fit.outcome);
          c.fit.simulated.resize(0);
          // Of the rows that it was estimated from, for Young's criterion.
          c.fit.output_error =
              c.fit.validation_error.array().isNaN().select(c.fit.output_error, kNaN);
        } catch (const Error& error) {
          // What is wrong with the data or the call is so for every order.
          if (error.fault() != Fault::kAnalysis || error.argument() == "inputs" ||
              error.argument() == "output") {
            throw;
          }
          c.failed = true;
          c.note = error.what();
        }
      },
      token);
  std::stable_sort(search.candidates.begin(), search.candidates.end(),
                   [criterion](const OrderCandidate& x, const OrderCandidate& y) {
                     return value_of(x, criterion) < value_of(y, criterion);
                   });
  recommend(search, criterion);
  for (OrderCandidate& c : search.candidates) c.fit.output_error.resize(0);
  return search;
}

}  // namespace ulna
