// Writes MJCF, the engine's model text, through an XML library. Numbers are written with as many
// digits as give them back exactly, whatever the locale.
#pragma once

#include <initializer_list>
#include <memory>
#include <string>
#include <string_view>

#include "base/types.hpp"

namespace tinyxml2 {
class XMLDocument;
class XMLElement;
}  // namespace tinyxml2

namespace ulna {

// One element of a document; valid as long as the document.
class MjcfElement {
 public:
  explicit MjcfElement(tinyxml2::XMLElement* element) : element_(element) {}

  MjcfElement child(const char* tag);
  MjcfElement named(const char* tag, const std::string& name);  // a child with a name

  // The <inertial> of a body: mass (kg), its centre (m) and the inertia about it (kg m^2), body
  // axes.
  void inertial(double mass, const Eigen::Vector3d& centre, const Eigen::Matrix3d& inertia);

  MjcfElement& set(const char* attribute, const std::string& value);
  MjcfElement& set(const char* attribute, const char* value);
  MjcfElement& set(const char* attribute, double value);
  MjcfElement& set(const char* attribute, std::initializer_list<double> values);
  MjcfElement& set(const char* attribute, const VectorRef& values);

 private:
  tinyxml2::XMLElement* element_;
};

// Principal moments and the axes that they belong to, in body axes. The engine's own way of finding
// them stops at a relative error of 1e-8, which would show in every torque.
struct PrincipalInertia {
  Eigen::Vector3d moments;
  Eigen::Vector4d quaternion;  // w x y z
};
PrincipalInertia principal_inertia(const Eigen::Matrix3d& inertia);

class MjcfDocument {
 public:
  explicit MjcfDocument(const std::string& model_name);
  ~MjcfDocument();
  MjcfDocument(const MjcfDocument&) = delete;
  MjcfDocument& operator=(const MjcfDocument&) = delete;

  MjcfElement root();  // <mujoco>
  std::string text() const;

 private:
  std::unique_ptr<tinyxml2::XMLDocument> document_;
};

}  // namespace ulna
