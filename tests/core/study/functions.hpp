// Functions whose sensitivity indices are known exactly.
#pragma once

#include <cmath>
#include <functional>
#include <vector>

#include "study/sampling.hpp"

namespace ulna {

using UnitFunction = std::function<double(const double*)>;

struct KnownFunction {
  std::string name;
  Index factors;
  UnitFunction value;
  Vector first;
  Vector total;
};

inline Vector numbers(std::initializer_list<double> list) {
  return Eigen::Map<const Vector>(list.begin(), static_cast<Index>(list.size()));
}

// Ishigami and Homma 1990 with a = 7; x on (-pi, pi)^3.
inline KnownFunction ishigami(double b = 0.1) {
  KnownFunction out;
  out.name = "ishigami";
  out.factors = 3;
  out.value = [b](const double* u) {
    const double x[] = {kPi * (2.0 * u[0] - 1.0), kPi * (2.0 * u[1] - 1.0),
                        kPi * (2.0 * u[2] - 1.0)};
    const double s = std::sin(x[1]);
    return std::sin(x[0]) + 7.0 * s * s + b * x[2] * x[2] * x[2] * x[2] * std::sin(x[0]);
  };
  if (b == 0.1) {
    out.first = numbers({0.313905191148, 0.442411144790, 0.0});
    out.total = numbers({0.557588855210, 0.442411144790, 0.243683664062});
  } else {  // b = 0.05
    out.first = numbers({0.218518564427, 0.686894643649, 0.0});
    out.total = numbers({0.313105356351, 0.686894643649, 0.0945867919243});
  }
  return out;
}

// Saltelli and Sobol' 1995: S_i and S_Ti in closed form.
inline KnownFunction sobol_g(const std::vector<double>& a) {
  KnownFunction out;
  out.name = "G with a = " + std::to_string(a[0]) + ", " + std::to_string(a[1]) + ", ...";
  out.factors = static_cast<Index>(a.size());
  out.value = [a](const double* u) {
    double product = 1.0;
    for (std::size_t i = 0; i < a.size(); ++i) {
      product *= (std::abs(4.0 * u[i] - 2.0) + a[i]) / (1.0 + a[i]);
    }
    return product;
  };
  double whole = 1.0;
  Vector part(out.factors);
  for (Index i = 0; i < out.factors; ++i) {
    const double scale = 1.0 + a[static_cast<std::size_t>(i)];
    part[i] = 1.0 / (3.0 * scale * scale);
    whole *= 1.0 + part[i];
  }
  const double variance = whole - 1.0;
  out.first = part / variance;
  out.total = (part.array() * whole / (1.0 + part.array()) / variance).matrix();
  return out;
}

inline KnownFunction bratley() {
  KnownFunction out;
  out.name = "bratley";
  out.factors = 6;
  out.value = [](const double* u) {
    double sum = 0.0;
    double product = 1.0;
    for (int i = 0; i < 6; ++i) {
      product *= u[i];
      sum += i % 2 == 0 ? -product : product;
    }
    return sum;
  };
  out.first =
      numbers({.6528636616, .1791303924, .03701041165, .0133237482, .001480416466, .001480416466});
  out.total =
      numbers({.7396477462, .265914477, .07642116935, .03431154542, .006238462804, .006238462804});
  return out;
}

// Morris 1991 with the random coefficients set to zero.
inline KnownFunction morris() {
  KnownFunction out;
  out.name = "morris";
  out.factors = 20;
  out.value = [](const double* u) {
    double w[10];
    for (int i = 0; i < 10; ++i) {
      const bool bent = i == 2 || i == 4 || i == 6;
      w[i] = 2.0 * ((bent ? 1.1 * u[i] / (u[i] + 0.1) : u[i]) - 0.5);
    }
    double y = 0.0;
    for (int i = 0; i < 10; ++i) y += 20.0 * w[i];
    for (int i = 0; i < 6; ++i) {
      for (int j = i + 1; j < 6; ++j) {
        y -= 15.0 * w[i] * w[j];
        for (int l = j + 1; l < 5; ++l) y -= 10.0 * w[i] * w[j] * w[l];
      }
    }
    return y + 5.0 * w[0] * w[1] * w[2] * w[3];
  };
  out.first = Vector::Zero(20);
  out.total = Vector::Zero(20);
  out.first.head(10) = numbers({.0069263356, .0069263356, .014973192, .0069263356, .014973192,
                                9.4975281e-6, .060947994, .12563637, .12563637, .12563637});
  out.total.head(10) = numbers({.25717197, .25717197, .11154116, .25717197, .11140007, .093535452,
                                .060947994, .12563637, .12563637, .12563637});
  return out;
}

inline std::vector<KnownFunction> known_functions() {
  return {ishigami(),
          ishigami(0.05),
          sobol_g({0.0, 0.5, 3.0, 9.0, 99.0, 99.0}),
          sobol_g({0.0, 0.0, 0.0, 0.0}),
          sobol_g({0.0, 1.0, 4.5, 9.0, 99.0, 99.0, 99.0, 99.0}),
          sobol_g({99.0, 99.0, 99.0}),
          sobol_g({0.0, 1.0, 2.0, 4.0, 8.0}),
          bratley(),
          morris()};
}

inline Vector run(const Sampling& sampling, const UnitFunction& function) {
  PointRows points(sampling.rows(), sampling.spec().factors);
  sampling.fill(0, points);
  Vector y(sampling.rows());
  for (Index i = 0; i < y.size(); ++i) y[i] = function(points.row(i).data());
  return y;
}

inline SamplingSpec study_of(Scheme scheme, Sampler sampler, Index factors, Index n,
                             std::uint64_t seed) {
  SamplingSpec spec;
  spec.scheme = scheme;
  spec.sampler = sampler;
  spec.factors = factors;
  spec.n = n;
  spec.seed = seed;
  return spec;
}

}  // namespace ulna
