// A square system as passivity sees it: its response on the imaginary axis with poles on the axis
// and at infinity taken out exactly, the flaws of its poles, and an oracle for the frequencies at
// which an eigenvalue of the Hermitian part (or a singular value) has a given level.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "passivity/axis_system.hpp"
#include "passivity/expansion.hpp"
#include "passivity/level_set.hpp"
#include "signal/system.hpp"

namespace ulna {

// What is below this share of the response is zero as far as double arithmetic can tell: rounding
// of a few dozen operations, and the 5e-16 of the expansions.
inline constexpr double kPortRounding = 1e-13;

enum class PortView { kDirect, kInverse, kScattering };

// A pole that a positive-real function must not have.
struct PoleFlaw {
  double omega = 0.0;      // rad/s, infinite for a pole at infinity
  bool on_axis = false;    // else in the open right half-plane
  bool certain = false;    // false: within the tolerance of what is allowed
  bool unbounded = false;  // the Hermitian part is not bounded below there
  std::string words;       // "a pole at 1 rad/s ..."
};

// Refers to the system, which must outlive it.
class PortFunction {
 public:
  // direction: empty, or a unit vector d: d' H d (kDirect), d' H^-1 d (kInverse), the scattering of
  // d' H d (kScattering).
  PortFunction(const System& system, PortView view, const Vector& direction, double tolerance);

  // False when what is to be inverted is singular at every frequency: nothing else holds then.
  bool exists() const { return exists_; }
  Index ports() const { return ports_; }
  const std::vector<PoleFlaw>& flaws() const { return flaws_; }
  // Poles in the open right half-plane that cancel.
  const std::vector<Complex>& hidden() const { return hidden_; }
  double scale() const { return scale_; }

  // Without the lossless principal parts of poles on the axis. omega may be infinite.
  Eigen::MatrixXcd response(double omega) const;
  // Smallest eigenvalue of the Hermitian part, or minus the largest singular value (kScattering).
  double value(double omega) const;
  // What rounding leaves of the response, absolute.
  double size(double omega) const;
  std::vector<double> crossings(double level) const;
  std::vector<double> likely_frequencies() const;

  // Smallest eigenvalue of the Hermitian part in units of the response, after ports whose part must
  // vanish at 0 or at infinity were scaled by omega (or 1/omega): positive exactly where the
  // Hermitian part is, without the zeros that structure puts there. Lossless ports are left out;
  // infinite when all are. kDirect only.
  double margin(double omega) const;

 private:
  struct Cluster {
    Complex center;
    double distance;  // to the next pole that is not in the cluster
    bool right = false;
    bool axis = false;
    bool exact = true;  // on the axis to rounding
  };

  void take_rational(const Vector& num, const Vector& den);
  std::vector<Cluster> clusters(double tolerance) const;
  void expand(const std::vector<Complex>& also, double tolerance);
  // False when the principal part is not lossless.
  bool judge(const Expansion& expansion, const Cluster& cluster, double tolerance);
  bool falls_towards(const Expansion& expansion, double omega) const;
  void find_structure();
  const Expansion* covering(double omega) const;
  double scaled_margin(const Expansion& expansion, double omega) const;

  PortView view_;
  bool exists_ = true;
  Index ports_ = 1;
  double scale_ = 1.0;
  MatrixFunction f_;
  std::vector<Complex> poles_;
  std::vector<double> landmarks_;
  std::optional<AxisSystem> axis_;
  // One port: value = p(x) / q(x) with x = (omega / scale)^2, highest power first.
  Vector p_, q_;
  std::vector<Expansion> expansions_;  // the first two about 0 and infinity
  std::vector<bool> stands_in_;        // for the function: not where the principal part counts
  std::vector<PoleFlaw> flaws_;
  std::vector<Complex> hidden_;
  std::vector<Index> lossy_;        // ports with a Hermitian part
  std::vector<bool> vanishing_[2];  // of lossy_, at 0 and at infinity
};

// Real and imaginary part of N(j x) conj(D(j x)) as polynomials in w^2: real(x), and imaginary / w.
struct AxisProduct {
  Vector real, odd;
};
AxisProduct axis_product(const Vector& n, const Vector& d);
// p(scale s), so that coefficients are of like size.
Vector in_units(const Vector& p, double scale);

}  // namespace ulna
