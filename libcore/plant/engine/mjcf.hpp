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

  MjcfElement& set(const char* attribute, const std::string& value);
  MjcfElement& set(const char* attribute, const char* value);
  MjcfElement& set(const char* attribute, double value);
  MjcfElement& set(const char* attribute, std::initializer_list<double> values);
  MjcfElement& set(const char* attribute, const VectorRef& values);

 private:
  tinyxml2::XMLElement* element_;
};

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
