#include "signal/zero_phase.hpp"

#include <algorithm>
#include <array>
#include <cstring>
#include <memory>
#include <string>
#include <vector>

#include "base/error.hpp"
#include "signal/finite.hpp"
#include "signal/lanes.hpp"

namespace ulna {
namespace {

using lanes::kLanes;

constexpr Index kTile = 64;  // rows transposed at a time: one tile stays in the first-level cache
constexpr int kStage = 3;    // sections run in one sweep; more would not fit the registers

// One section in transposed direct form II, with its state for a unit constant input.
struct Section {
  double b0, b1, b2, a1, a2;
  double unit0, unit1;
};

// Steady states as scipy.signal.sosfilt_zi: each section is fed the DC gain of those before it.
std::vector<Section> make_sections(const Sos& sos) {
  std::vector<Section> result;
  double input = 1.0;
  for (Index i = 0; i < sos.sections.rows(); ++i) {
    const auto c = sos.sections.row(i);
    Section s{c(0), c(1), c(2), c(4), c(5), 0.0, 0.0};
    const double gain = (s.b0 + s.b1 + s.b2) / (1.0 + s.a1 + s.a2);
    // y = gain x for constant x: z1 = b2 x - a2 y and z0 = b1 x - a1 y + z1.
    s.unit1 = (s.b2 - s.a2 * gain) * input;
    s.unit0 = (s.b1 - s.a1 * gain) * input + s.unit1;
    input *= gain;
    result.push_back(s);
  }
  return result;
}

// Runs S sections over `rows` rows of eight lanes, in place; step is +kLanes or -kLanes doubles.
// z: z0 and z1 of each section, eight lanes each.
struct Sweep {
  const Section* sections;
  double* z;
  double* data;
  Index rows;
  Index step;
};

// The recursions of a section over successive samples are one chain of dependent operations; the
// chains of the lanes and, one sample apart, of the sections overlap in the processor's pipeline.
template <class R, int S>
ULNA_INLINE void sweep_body(const Sweep& a) {
  using V = typename R::V;
  constexpr int kWidth = R::kWidth;
  constexpr int kParts = 2;  // more state would not fit the registers
  for (int lane = 0; lane < static_cast<int>(kLanes); lane += kParts * kWidth) {
    V z0[S][kParts], z1[S][kParts];
    for (int s = 0; s < S; ++s) {
      for (int p = 0; p < kParts; ++p) {
        z0[s][p] = lanes::load<R>(a.z + (2 * s) * kLanes + lane + p * kWidth);
        z1[s][p] = lanes::load<R>(a.z + (2 * s + 1) * kLanes + lane + p * kWidth);
      }
    }
    double* data = a.data + lane;
    for (Index i = 0; i < a.rows; ++i, data += a.step) {
      for (int p = 0; p < kParts; ++p) {
        V x = lanes::load<R>(data + p * kWidth);
        for (int s = 0; s < S; ++s) {
          const Section& c = a.sections[s];
          const V y = x * c.b0 + z0[s][p];
          z0[s][p] = (x * c.b1 - y * c.a1) + z1[s][p];
          z1[s][p] = x * c.b2 - y * c.a2;
          x = y;
        }
        lanes::store<R>(data + p * kWidth) = x;
      }
    }
    for (int s = 0; s < S; ++s) {
      for (int p = 0; p < kParts; ++p) {
        lanes::store<R>(a.z + (2 * s) * kLanes + lane + p * kWidth) = z0[s][p];
        lanes::store<R>(a.z + (2 * s + 1) * kLanes + lane + p * kWidth) = z1[s][p];
      }
    }
  }
}

template <class R>
ULNA_INLINE void sweep_any(const Sweep& a, std::size_t sections) {
  if (sections == 1) return sweep_body<R, 1>(a);
  if (sections == 2) return sweep_body<R, 2>(a);
  sweep_body<R, kStage>(a);
}

void sweep_base(const Sweep& a, std::size_t sections) { sweep_any<lanes::Base>(a, sections); }
#ifdef ULNA_AVX2
ULNA_AVX2 void sweep_avx2(const Sweep& a, std::size_t sections) {
  sweep_any<lanes::Avx2>(a, sections);
}
#endif

void run_sweep(const Sweep& a, std::size_t sections) {
#ifdef ULNA_AVX2
  if (lanes::have_avx2()) return sweep_avx2(a, sections);
#endif
  sweep_base(a, sections);
}

class Cascade {
 public:
  explicit Cascade(const std::vector<Section>& sections)
      : sections_(sections), z_(sections.size() * 2 * kLanes) {}

  // The steady state for the constant input first[lane].
  void settle(const double* first) {
    double* z = z_.data();
    for (const Section& section : sections_) {
      for (Index lane = 0; lane < kLanes; ++lane) {
        z[lane] = section.unit0 * first[lane];
        z[kLanes + lane] = section.unit1 * first[lane];
      }
      z += 2 * kLanes;
    }
  }

  void run(double* data, Index rows, Index step) {
    for (std::size_t s = 0; s < sections_.size(); s += kStage) {
      run_sweep({sections_.data() + s, z_.data() + s * 2 * kLanes, data, rows, step},
                std::min<std::size_t>(kStage, sections_.size() - s));
    }
  }

 private:
  const std::vector<Section>& sections_;
  std::vector<double> z_;
};

// Value of the oddly extended column at row - pad, for any row of the extension.
double extended(const double* column, Index rows, Index at) {
  if (at < 0) return 2.0 * column[0] - column[-at];
  if (at >= rows) return 2.0 * column[rows - 1] - column[2 * (rows - 1) - at];
  return column[at];
}

// Rows [first, first + count) of the extended columns, eight lanes a row. Lanes without a column
// are 0.
void gather(const double* const* columns, Index used, Index rows, Index first, Index count,
            double* out) {
  const bool inside = first >= 0 && first + count <= rows;
  if (used < kLanes) std::memset(out, 0, static_cast<std::size_t>(count * kLanes) * sizeof(double));
  for (Index lane = 0; lane < used; ++lane) {
    const double* column = columns[lane];
    double* to = out + lane;
    if (inside) {
      for (Index i = 0; i < count; ++i) to[i * kLanes] = column[first + i];
    } else {
      for (Index i = 0; i < count; ++i) to[i * kLanes] = extended(column, rows, first + i);
    }
  }
}

// Writes the rows of a tile that lie inside the columns; tile row i is column row first + i.
void scatter(const double* tile, Index first, Index count, Index rows, Index used,
             double* const* columns) {
  const Index from = std::max<Index>(0, -first);
  const Index to = std::min(count, rows - first);
  for (Index lane = 0; lane < used; ++lane) {
    for (Index i = from; i < to; ++i) columns[lane][first + i] = tile[i * kLanes + lane];
  }
}

// Up to eight columns: forward through a buffer of all extended rows, back tile by tile.
void filter_lanes(const std::vector<Section>& sections, Index pad, Index rows, Index used,
                  double* const* columns, double* buffer) {
  const Index total = rows + 2 * pad;
  Cascade cascade(sections);
  for (Index first = 0; first < total; first += kTile) {
    const Index count = std::min(kTile, total - first);
    double* tile = buffer + first * kLanes;
    gather(columns, used, rows, first - pad, count, tile);
    if (first == 0) cascade.settle(tile);
    cascade.run(tile, count, kLanes);
  }
  cascade.settle(buffer + (total - 1) * kLanes);
  const Index tiles = (total + kTile - 1) / kTile;
  for (Index t = tiles - 1; t >= 0; --t) {
    const Index first = t * kTile;
    const Index count = std::min(kTile, total - first);
    double* tile = buffer + first * kLanes;
    cascade.run(tile + (count - 1) * kLanes, count, -kLanes);
    scatter(tile, first - pad, count, rows, used, columns);
    if (first <= pad) break;  // what is left is the extension, which nobody reads
  }
}

Index scipy_pad(const Sos& sos) {
  const Matrix& s = sos.sections;
  const Index zeros = (s.col(2).array() == 0.0).count();
  const Index poles = (s.col(5).array() == 0.0).count();
  return 3 * (2 * s.rows() + 1 - std::min(zeros, poles));
}

}  // namespace

Index pad_samples(const Sos& sos, const ZeroPhase& options) {
  check_sos(sos);
  if (options.pad == Pad::kScipy) return scipy_pad(sos);
  return settle_samples(sos, options.epsilon);
}

Index effective_pad_samples(const Sos& sos, const ZeroPhase& options, Index rows) {
  return std::clamp<Index>(pad_samples(sos, options), 0, std::max<Index>(rows - 1, 0));
}

void filter_zero_phase(const Sos& sos, const ZeroPhase& options, Eigen::Ref<Matrix> signals) {
  const Index rows = signals.rows();
  const Index pad = effective_pad_samples(sos, options, rows);
  if (rows < 2) {
    throw Error(Fault::kData, "y",
                "the signal has " + std::to_string(rows) +
                    " samples: a zero-phase filter needs at least 2");
  }
  require_finite(signals, "y");

  const std::vector<Section> sections = make_sections(sos);
  const auto buffer =
      std::make_unique_for_overwrite<double[]>(static_cast<std::size_t>((rows + 2 * pad) * kLanes));
  for (Index j = 0; j < signals.cols(); j += kLanes) {
    const Index used = std::min(kLanes, signals.cols() - j);
    std::array<double*, kLanes> columns{};
    for (Index lane = 0; lane < used; ++lane) {
      columns[static_cast<std::size_t>(lane)] = signals.col(j + lane).data();
    }
    filter_lanes(sections, pad, rows, used, columns.data(), buffer.get());
  }
}

}  // namespace ulna
