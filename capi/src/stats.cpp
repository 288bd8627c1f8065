#include <ulna/stats.h>

#include <cmath>

#include "arguments.hpp"
#include "guard.hpp"
#include "handles.hpp"
#include "stats/anova.hpp"
#include "stats/distributions.hpp"
#include "study.hpp"
#include "study/paired.hpp"

using namespace ulna;
using namespace ulna::capi;

namespace {

// The level at which normal quantiles reach as far as Student's t does for the true spread of n
// subjects, of which a bootstrap shows sqrt((n - 1) / n).
double expanded_level(double level, Index subjects) {
  const auto n = static_cast<double>(subjects);
  const double t = student_quantile(0.5 * (1.0 + level), n - 1.0) * std::sqrt(n / (n - 1.0));
  return std::erf(t / std::sqrt(2.0));
}

IntervalSpec paired_interval(const ulna_paired_options* options, Index subjects) {
  const ulna_paired_options o = read_options(options, "options");
  IntervalSpec out;
  out.kind = flag(o.percentile, "percentile") ? IntervalKind::kPercentile : IntervalKind::kBca;
  out.level = or_default(o.level, 0.95);
  require(out.level > 0.0 && out.level < 1.0, "level", "level must lie between 0 and 1");
  if (!flag(o.plain, "plain")) out.level = expanded_level(out.level, subjects);
  out.resamples = o.resamples == 0 ? 5000 : o.resamples;
  out.seed = static_cast<std::uint64_t>(o.seed);
  out.threads = o.threads;
  return out;
}

// Measures one after the other; within one the statistics, each value, error, low, high.
Vector paired_table(const PairedEstimates& all) {
  const Index measures = all.difference.value.size();
  Vector out(12 * measures);
  Index at = 0;
  for (Index m = 0; m < measures; ++m) {
    for (const Estimates* e : {&all.difference, &all.relative, &all.standardised}) {
      for (const Vector* v : {&e->value, &e->error, &e->low, &e->high}) out[at++] = (*v)[m];
    }
  }
  return out;
}

}  // namespace

ulna_status ulna_anova_repeated(const ulna_view* values, int64_t levels_first,
                                int64_t levels_second, int32_t effect,
                                ulna_anova_effect* out_effect) {
  return guarded([&] {
    deref(out_effect, "out_effect");
    const AnovaEffect e = repeated_anova(map_view(values, "values"), levels_first, levels_second,
                                         kind_of<AnovaEffectKind>(effect, 3, "effect"));
    write_result(out_effect,
                 {0, e.sum_of_squares, e.error_sum_of_squares, e.dof, e.error_dof, e.f, e.p,
                  e.epsilon, e.p_corrected, e.partial_eta_squared},
                 "out_effect");
  });
}

ulna_status ulna_f_tail(double f, double dof, double error_dof, double* out_p) {
  return guarded([&] { deref(out_p, "out_p") = f_tail(f, dof, error_dof); });
}

ulna_status ulna_paired_compare(const ulna_view* first, const ulna_view* second,
                                const ulna_paired_options* options, ulna_token* token, double* out,
                                int64_t capacity, int64_t* out_count) {
  return guarded([&] {
    const StridedMap before = map_view(first, "first");
    require(before.rows() >= 3 && before.cols() >= 1, "first",
            "a comparison needs at least 3 subjects and 1 measure");
    const IntervalSpec spec = paired_interval(options, before.rows());
    if (study_count_only(12 * before.cols(), out, capacity, out_count)) return;
    const Matrix after = map_view(second, "second");
    const Vector table = paired_table(paired_estimates(before, after, spec, token_of(token)));
    write_array(table.data(), table.size(), out, capacity, out_count);
  });
}
