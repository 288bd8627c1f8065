#include <ulna/system.h>

#include <algorithm>
#include <memory>
#include <string>
#include <vector>

#include "guard.hpp"
#include "handles.hpp"
#include "signal/system.hpp"

using namespace ulna;
using namespace ulna::capi;

namespace {

using RowMajor = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

std::vector<Vector> rows_of(const ulna_view* view, const char* argument, int64_t count) {
  const StridedMap map = map_view(view, argument);
  require(map.rows() == count, argument,
          std::string(argument) + " has " + std::to_string(map.rows()) +
              " rows and must have outputs x inputs = " + std::to_string(count));
  std::vector<Vector> out;
  for (Index i = 0; i < map.rows(); ++i) out.emplace_back(map.row(i).transpose());
  return out;
}

void write_system(System system, ulna_system** out_system) {
  ulna_system*& out = deref(out_system, "out_system");
  out = std::make_unique<ulna_system>(ulna_system{std::move(system)}).release();
}

Index longest(const std::vector<Vector>& polynomials) {
  Index most = 0;
  for (const Vector& p : polynomials) most = std::max(most, p.size());
  return most;
}

std::vector<double> padded(const std::vector<Vector>& polynomials) {
  const Index length = longest(polynomials);
  std::vector<double> out;
  for (const Vector& p : polynomials) {
    out.insert(out.end(), static_cast<std::size_t>(length - p.size()), 0.0);
    out.insert(out.end(), p.data(), p.data() + p.size());
  }
  return out;
}

std::vector<double> by_rows(const Matrix& m) {
  const RowMajor turned = m;
  return {turned.data(), turned.data() + turned.size()};
}

std::vector<double> pairs(const std::vector<Complex>& values) {
  std::vector<double> out;
  for (const Complex z : values) out.insert(out.end(), {z.real(), z.imag()});
  return out;
}

std::vector<double> values_of(const System& s, int32_t which) {
  const StateSpace& m = s.state_space();
  const std::vector<Vector> none;
  switch (which) {
    case ULNA_SYSTEM_NUM:
      return padded(s.rational() ? s.rational()->num : none);
    case ULNA_SYSTEM_DEN:
      return padded(s.rational() ? s.rational()->den : none);
    case ULNA_SYSTEM_A:
      return by_rows(m.a);
    case ULNA_SYSTEM_B:
      return by_rows(m.b);
    case ULNA_SYSTEM_C:
      return by_rows(m.c);
    case ULNA_SYSTEM_D:
      return by_rows(m.d);
    case ULNA_SYSTEM_E:
      return by_rows(m.e);
    case ULNA_SYSTEM_POLES:
      return pairs(s.poles());
    case ULNA_SYSTEM_ZEROS:
      return pairs(s.zeros());
    default:
      throw Error(Fault::kArgument, "which", "which must be an ULNA_SYSTEM_ constant");
  }
}

System combined(const System& first, const System& second, int32_t how) {
  switch (how) {
    case ULNA_COMBINE_PARALLEL:
      return in_parallel(first, second);
    case ULNA_COMBINE_SERIES:
      return in_series(first, second);
    case ULNA_COMBINE_LOOP:
      return in_loop(first, second);
    default:
      throw Error(Fault::kArgument, "how", "how must be an ULNA_COMBINE_ constant");
  }
}

}  // namespace

ulna_status ulna_system_new_rational(const ulna_view* num, const ulna_view* den, int64_t outputs,
                                     int64_t inputs, ulna_system** out_system) {
  return guarded([&] {
    require(outputs >= 1 && inputs >= 1 && outputs < 1000 && inputs < 1000, "outputs",
            "a system needs from 1 to 999 outputs and inputs");
    const int64_t count = outputs * inputs;
    write_system(System(TransferMatrix{outputs, inputs, rows_of(num, "num", count),
                                       rows_of(den, "den", count)}),
                 out_system);
  });
}

ulna_status ulna_system_new_state_space(const ulna_view* a, const ulna_view* b, const ulna_view* c,
                                        const ulna_view* d, const ulna_view* e,
                                        ulna_system** out_system) {
  return guarded([&] {
    StateSpace model{map_view(a, "a"), map_view(b, "b"), map_view(c, "c"), map_view(d, "d"),
                     Matrix()};
    if (e != nullptr) model.e = map_view(e, "e");
    write_system(System(std::move(model)), out_system);
  });
}

void ulna_system_free(ulna_system* system) { delete system; }

ulna_status ulna_system_get_info(const ulna_system* system, ulna_system_info* out_info) {
  return guarded([&] {
    const System& s = deref(system, "system").system;
    ulna_system_info info = {};
    info.outputs = s.outputs();
    info.inputs = s.inputs();
    info.states = s.states();
    info.num_length = s.rational() ? longest(s.rational()->num) : 0;
    info.den_length = s.rational() ? longest(s.rational()->den) : 0;
    info.scale_rad_s = s.scale();
    info.rational = s.rational() ? 1 : 0;
    info.proper = s.is_proper() ? 1 : 0;
    write_result(out_info, info, "out_info");
  });
}

ulna_status ulna_system_get_values(const ulna_system* system, int32_t which, double* out,
                                   int64_t capacity, int64_t* out_count) {
  return guarded([&] {
    const std::vector<double> values = values_of(deref(system, "system").system, which);
    write_array(values.data(), static_cast<int64_t>(values.size()), out, capacity, out_count);
  });
}

ulna_status ulna_system_respond(const ulna_system* system, const ulna_view* omega_rad_s,
                                double* out, int64_t capacity, int64_t* out_count) {
  return guarded([&] {
    const System& s = deref(system, "system").system;
    const StridedMap omega = map_view(omega_rad_s, "omega_rad_s");
    require(omega.cols() == 1, "omega_rad_s", "omega_rad_s must have one column");
    std::vector<double> values;
    for (Index i = 0; i < omega.rows(); ++i) {
      const Eigen::MatrixXcd h = s(Complex(0.0, omega(i, 0)));
      for (Index k = 0; k < h.size(); ++k) {
        const Complex z = h(k / h.cols(), k % h.cols());
        values.insert(values.end(), {z.real(), z.imag()});
      }
    }
    write_array(values.data(), static_cast<int64_t>(values.size()), out, capacity, out_count);
  });
}

ulna_status ulna_system_combine(const ulna_system* first, const ulna_system* second, int32_t how,
                                ulna_system** out_system) {
  return guarded([&] {
    write_system(combined(deref(first, "first").system, deref(second, "second").system, how),
                 out_system);
  });
}

ulna_status ulna_system_convert(const ulna_system* system, int32_t form, ulna_system** out_system) {
  return guarded([&] {
    const System& s = deref(system, "system").system;
    require(form == ULNA_FORM_STATE_SPACE || form == ULNA_FORM_RATIONAL, "form",
            "form must be an ULNA_FORM_ constant");
    write_system(form == ULNA_FORM_RATIONAL ? as_rational(s) : as_state_space(s), out_system);
  });
}
