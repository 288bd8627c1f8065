#include "ident/strain_gauge.hpp"

#include <Eigen/LU>
#include <Eigen/QR>
#include <algorithm>
#include <cmath>

#include "base/error.hpp"
#include "base/words.hpp"
#include "record/append.hpp"
#include "stats/distributions.hpp"

namespace ulna {

namespace {

// Two-sided p value of Student's t, from the quantile.
double student_p(double t, double dof) {
  if (!std::isfinite(t)) return 0.0;
  double low = 0.5;
  double high = 1.0;
  for (int i = 0; i < 60; ++i) {
    const double middle = 0.5 * (low + high);
    if (middle >= 1.0) break;
    (student_quantile(middle, dof) < std::abs(t) ? low : high) = middle;
  }
  return 2.0 * (1.0 - low);
}

void check_points(const Vector& volts, const Vector& forces, const Vector& errors) {
  require(volts.size() == forces.size(), "forces_n",
          "there are " + std::to_string(volts.size()) + " voltages and " +
              std::to_string(forces.size()) + " forces: give one force for every voltage");
  require(errors.size() == 0 || errors.size() == volts.size(), "errors_n",
          "there are " + std::to_string(errors.size()) + " errors for " +
              std::to_string(volts.size()) + " points: give one for every point, or none");
  for (Index i = 0; i < volts.size(); ++i) {
    if (!std::isfinite(volts[i]) || !std::isfinite(forces[i])) {
      throw Error(Fault::kData, "volts",
                  "calibration point " + std::to_string(i) + " is no number: leave it out",
                  "row " + std::to_string(i));
    }
    if (errors.size() > 0 && !(std::isfinite(errors[i]) && errors[i] > 0.0)) {
      throw Error(Fault::kArgument, "errors_n",
                  "the error of calibration point " + std::to_string(i) + " must be above zero",
                  "row " + std::to_string(i));
    }
  }
  if (volts.size() < 3) {
    throw Error(Fault::kAnalysis, "volts",
                "a line with its errors needs at least three calibration points");
  }
  const double spread = volts.maxCoeff() - volts.minCoeff();
  if (!(spread > 1e-9 * volts.cwiseAbs().maxCoeff())) {
    throw Error(Fault::kAnalysis, "volts",
                "all calibration points have the same voltage: load the sensor with different "
                "forces, or check its wiring");
  }
}

void check_gauge(const StrainGauge& gauge, const GaugeOptions& options) {
  for (const CalibrationLine* line : {&gauge.x, &gauge.y}) {
    require(std::isfinite(line->slope) && line->slope != 0.0 && std::isfinite(line->intercept),
            "gauge", "a calibration line needs a finite intercept and a slope that is not zero");
  }
  const auto length = [](double value, const char* argument) {
    require(std::isfinite(value) && value > 0.0, argument,
            "the lever arm from the gauges to the force must be above zero, in metres");
  };
  length(gauge.lever_m, "calibration_lever_m");
  if (options.lever_m != 0.0) length(options.lever_m, "lever_m");
  require(gauge.lever_error_m >= 0.0 && options.lever_error_m >= 0.0, "lever_error_m",
          "the error of a lever arm must not be negative");
  require(options.sign == 1 || options.sign == -1, "sign", "the sign is 1 or -1");
}

}  // namespace

CalibrationLine calibrate_line(const Vector& volts, const Vector& forces, const Vector& errors,
                               bool relative) {
  check_points(volts, forces, errors);
  const Index n = volts.size();
  const Vector weight = errors.size() == 0 ? Vector::Ones(n) : Vector(errors.cwiseInverse());
  Matrix a(n, 2);
  a << volts.cwiseProduct(weight), weight;
  const Vector y = forces.cwiseProduct(weight);
  const Eigen::HouseholderQR<Matrix> qr(a);
  const Vector line = qr.solve(y);
  const Vector residual = y - a * line;
  const double dof = static_cast<double>(n - 2);
  const double sum = residual.squaredNorm();

  CalibrationLine out;
  out.points = n;
  out.slope = line[0];
  out.intercept = line[1];
  const Matrix2 inverse =
      (qr.matrixQR().topRows(2).triangularView<Eigen::Upper>().toDenseMatrix().transpose() *
       qr.matrixQR().topRows(2).triangularView<Eigen::Upper>().toDenseMatrix())
          .inverse();
  const bool absolute = errors.size() > 0 && !relative;
  out.covariance = inverse * (absolute ? 1.0 : sum / dof);
  const Vector squares = weight.cwiseAbs2();
  const double mean = squares.dot(forces) / squares.sum();
  const double total = squares.dot((forces.array() - mean).square().matrix());
  out.r_squared = total > 0.0 ? 1.0 - sum / total : kNaN;
  // Of a point of average weight: with unequal errors there is no one standard deviation.
  out.residual_n = std::sqrt(sum / dof * static_cast<double>(n) / squares.sum());
  out.chi_square = absolute ? sum : kNaN;
  out.fit_p = absolute ? chi_square_tail(sum, dof) : kNaN;

  const double scale = std::sqrt(absolute ? 1.0 : sum / dof);
  const Matrix q = qr.householderQ() * Matrix::Identity(n, 2);
  for (Index i = 0; i < n; ++i) {
    const double left = 1.0 - q.row(i).squaredNorm();
    const double studentised =
        scale > 0.0 && left > 1e-12 ? residual[i] / (scale * std::sqrt(left)) : 0.0;
    if (std::abs(studentised) > std::abs(out.largest_residual)) {
      out.largest_residual = studentised;
      out.largest_row = i;
    }
  }

  // Points on the line to rounding: neither a stray point nor a curvature to speak of.
  const bool exact = sum <= 1e-24 * y.squaredNorm();
  const double r2 = out.largest_residual * out.largest_residual;
  if (exact) {
    out.outlier_p = 1.0;
  } else if (absolute) {
    out.outlier_p = std::min(1.0, static_cast<double>(n) * chi_square_tail(r2, 1.0));
  } else if (n > 3) {
    // An internally studentised residual is at most sqrt(dof), whatever the point: take it out of
    // the scatter that it is compared with.
    const double t = std::sqrt(r2 * (dof - 1.0) / std::max(0.0, dof - r2));
    out.outlier_p = std::min(1.0, static_cast<double>(n) * student_p(t, dof - 1.0));
  } else {
    out.outlier_p = kNaN;
  }

  out.curvature_p = kNaN;
  if (n > 3) {
    // What V^2 holds beside the line, and how much of the residuals that explains.
    const Vector square = volts.cwiseAbs2().cwiseProduct(weight);
    const Vector left = square - q * (q.transpose() * square);
    if (left.squaredNorm() > 1e-18 * square.squaredNorm()) {
      const double coefficient = left.dot(residual) / left.squaredNorm();
      const double rest = std::max(sum - coefficient * coefficient * left.squaredNorm(), 0.0);
      const double variance = absolute ? 1.0 : rest / (dof - 1.0);
      const double t = coefficient * left.norm() / std::sqrt(variance);
      out.curvature_p = exact      ? 1.0
                        : absolute ? chi_square_tail(t * t, 1.0)
                                   : student_p(t, dof - 1.0);
    }
  }
  return out;
}

StrainGauge published_gauge() {
  StrainGauge out;
  out.x.slope = -8.56;
  out.x.intercept = 0.54;
  out.x.covariance.diagonal() << 0.03 * 0.03, 0.06 * 0.06;
  out.x.r_squared = 0.9996;
  out.y.slope = -8.15;
  out.y.intercept = 2.3;
  out.y.covariance.diagonal() << 0.06 * 0.06, 0.1 * 0.1;
  out.y.r_squared = 0.9989;
  return out;
}

GaugedForce apply_gauge(const Record& record, const StrainGauge& gauge,
                        const GaugeOptions& options) {
  check_gauge(gauge, options);
  const std::vector<Index> volts = channels_of(record, options.volts, "volts");
  require(volts.size() == 2, "volts",
          "the sensor has two axes, but " + std::to_string(volts.size()) +
              " channels are named: name x_s, then y_s");
  require_unit(record, volts, "V", "name the sensor's raw voltages, or correct the unit in a map");
  std::vector<Index> used = volts;
  Index angle = -1;
  if (!options.angle.empty()) {
    const std::vector<Index> found = channels_of(record, options.angle + ",", "angle");
    require_unit(record, found, "rad", "name the angle of the link that carries the sensor");
    angle = found[0];
    used.push_back(angle);
  }
  for (const Index c : used) {
    for (Index row = 0; row < record.rows(); ++row) {
      if (std::isfinite(record.values()(row, c))) continue;
      const std::string& name = record.channels()[static_cast<std::size_t>(c)].name;
      throw Error(Fault::kData, name,
                  "channel " + name + " has no number in row " + std::to_string(row) +
                      ": repair it or split the record there",
                  "row " + std::to_string(row));
    }
  }

  const Index rows = record.rows();
  const double lever = options.lever_m == 0.0 ? gauge.lever_m : options.lever_m;
  const double scale = options.sign * gauge.lever_m / lever;  // (E.3)
  const CalibrationLine* const lines[2] = {&gauge.x, &gauge.y};
  Matrix raw(rows, 2);      // volts, from the zero on
  Vector zero_variance(2);  // of the force at zero volts
  const bool rest = options.zero == GaugeZero::kRest;
  if (rest) {
    require(options.rest_begin >= 0 && options.rest_end <= rows &&
                options.rest_end - options.rest_begin >= 2,
            "rest", "the rest without force must be at least two rows within the record");
  }
  for (Index i = 0; i < 2; ++i) {
    const Vector v = record.column(volts[static_cast<std::size_t>(i)]);
    const CalibrationLine& line = *lines[i];
    if (rest) {
      const auto still = v.segment(options.rest_begin, options.rest_end - options.rest_begin);
      const double mean = still.mean();
      raw.col(i) = v.array() - mean;
      const double count = static_cast<double>(still.size());
      zero_variance[i] =
          line.slope * line.slope * (still.array() - mean).square().sum() / ((count - 1.0) * count);
    } else {
      raw.col(i) = v;
      zero_variance[i] = line.covariance(1, 1);
    }
  }

  // From the sensor's axes to the force channels, one matrix a row. (E.4)
  const auto turn = [&](Index row, const Vector2& in) -> Vector2 {
    if (angle < 0) return in;
    const double s = std::sin(record.values()(row, angle));
    const double c = std::cos(record.values()(row, angle));
    return {s * in[0] + c * in[1], -c * in[0] + s * in[1]};
  };
  Matrix force(rows, 2);
  std::vector<Matrix> sensitivity(5, Matrix(rows, 2));
  for (Index row = 0; row < rows; ++row) {
    Vector2 sensed;
    for (Index i = 0; i < 2; ++i) {
      sensed[i] = scale * (lines[i]->slope * raw(row, i) + (rest ? 0.0 : lines[i]->intercept));
    }
    const Vector2 turned = turn(row, sensed);
    force.row(row) = turned.transpose();
    for (Index i = 0; i < 2; ++i) {
      const Vector2 unit = Vector2::Unit(i) * scale;
      sensitivity[static_cast<std::size_t>(2 * i)].row(row) =
          turn(row, unit * raw(row, i)).transpose();
      sensitivity[static_cast<std::size_t>(2 * i + 1)].row(row) = turn(row, unit).transpose();
    }
    sensitivity[4].row(row) = turned.transpose();
  }

  GaugedForce out{record, {}};
  out.errors.names = {"slope x", "zero x", "slope y", "zero y", "lever"};
  out.errors.sensitivity = std::move(sensitivity);
  out.errors.covariance = Matrix::Zero(5, 5);
  for (Index i = 0; i < 2; ++i) {
    out.errors.covariance(2 * i, 2 * i) = lines[i]->covariance(0, 0);
    out.errors.covariance(2 * i + 1, 2 * i + 1) = zero_variance[i];
    if (!rest) {
      out.errors.covariance(2 * i, 2 * i + 1) = lines[i]->covariance(0, 1);
      out.errors.covariance(2 * i + 1, 2 * i) = lines[i]->covariance(0, 1);
    }
  }
  // The lever of this recording is the calibration's own where none is given: no error then.
  const double relative = options.lever_m == 0.0 ? options.lever_error_m / lever
                                                 : std::hypot(options.lever_error_m / lever,
                                                              gauge.lever_error_m / gauge.lever_m);
  out.errors.covariance(4, 4) = relative * relative;

  std::vector<Channel> channels(2);
  for (std::size_t i = 0; i < 2; ++i) {
    const Channel& source = record.channels()[static_cast<std::size_t>(volts[i])];
    channels[i].name = options.name + (i == 0 ? "_x" : "_y");
    channels[i].unit = "N";
    channels[i].frame = angle < 0 ? "sensor" : "world";
    channels[i].role = Role::kForce;
    channels[i].axis = static_cast<int>(i);
    channels[i].source_name = source.name;
    channels[i].source_unit = "V";
  }
  const std::string zero =
      rest ? sentence(6, "zero from rows ", options.rest_begin, " to ", options.rest_end)
           : sentence(6, "intercepts ", gauge.x.intercept, " and ", gauge.y.intercept, " N");
  out.record = append_channels(
      record, force, channels,
      sentence(6, "strain gauge: ", channels[0].name, " and ", channels[1].name, " from ",
               channels[0].source_name, " and ", channels[1].source_name, ", slopes ",
               gauge.x.slope, " and ", gauge.y.slope, " N/V, ", zero, ", lever ", lever,
               " m (calibrated at ", gauge.lever_m, " m), ",
               angle < 0 ? std::string("not turned")
                         : "turned by " + record.channels()[static_cast<std::size_t>(angle)].name,
               options.sign < 0 ? ", sign reversed" : ""));
  return out;
}

}  // namespace ulna
