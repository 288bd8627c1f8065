#include "plant/engine/mjcf.hpp"

#include <tinyxml2.h>

#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>
#include <charconv>

namespace ulna {
namespace {

void append_number(std::string& text, double value) {
  char digits[32];
  const auto [end, failure] = std::to_chars(digits, digits + sizeof digits, value);
  static_cast<void>(failure);  // 32 characters hold every double
  if (!text.empty()) text += ' ';
  text.append(digits, end);
}

}  // namespace

MjcfElement MjcfElement::child(const char* tag) {
  return MjcfElement(element_->InsertNewChildElement(tag));
}

MjcfElement MjcfElement::named(const char* tag, const std::string& name) {
  return child(tag).set("name", name);
}

PrincipalInertia principal_inertia(const Eigen::Matrix3d& inertia) {
  if (inertia.isDiagonal(0.0)) return {inertia.diagonal(), Eigen::Vector4d::UnitX()};
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver(inertia);
  Eigen::Matrix3d axes = solver.eigenvectors();
  if (axes.determinant() < 0.0) axes.col(2) = -axes.col(2);
  const Eigen::Quaterniond q(axes);
  return {solver.eigenvalues(), Eigen::Vector4d(q.w(), q.x(), q.y(), q.z())};
}

void MjcfElement::inertial(double mass, const Eigen::Vector3d& centre,
                           const Eigen::Matrix3d& inertia) {
  const PrincipalInertia principal = principal_inertia(inertia);
  child("inertial")
      .set("pos", centre)
      .set("mass", mass)
      .set("quat", principal.quaternion)
      .set("diaginertia", principal.moments);
}

MjcfElement& MjcfElement::set(const char* attribute, const char* value) {
  element_->SetAttribute(attribute, value);
  return *this;
}

MjcfElement& MjcfElement::set(const char* attribute, const std::string& value) {
  return set(attribute, value.c_str());
}

MjcfElement& MjcfElement::set(const char* attribute, double value) {
  return set(attribute, {value});
}

MjcfElement& MjcfElement::set(const char* attribute, std::initializer_list<double> values) {
  std::string text;
  for (const double value : values) append_number(text, value);
  return set(attribute, text);
}

MjcfElement& MjcfElement::set(const char* attribute, const VectorRef& values) {
  std::string text;
  for (Index i = 0; i < values.size(); ++i) append_number(text, values[i]);
  return set(attribute, text);
}

MjcfDocument::MjcfDocument(const std::string& model_name)
    : document_(std::make_unique<tinyxml2::XMLDocument>()) {
  tinyxml2::XMLElement* root = document_->NewElement("mujoco");
  root->SetAttribute("model", model_name.c_str());
  document_->InsertEndChild(root);
}

MjcfDocument::~MjcfDocument() = default;

MjcfElement MjcfDocument::root() { return MjcfElement(document_->RootElement()); }

std::string MjcfDocument::text() const {
  tinyxml2::XMLPrinter printer;
  document_->Print(&printer);
  return printer.CStr();
}

}  // namespace ulna
