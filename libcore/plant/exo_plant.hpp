// The compiled exoskeleton and arm: an immutable plant that runs share, with the nominal model of
// the same description beside it.
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "plant/engine/model.hpp"
#include "plant/engine/run.hpp"
#include "plant/exo_scene.hpp"

namespace ulna {

class ExoPlant {
 public:
  // Compiles a scene and sets each muscle's length range from its path: the shortest and longest
  // over the elbow's range with the shoulder in its reference (elbow muscles), or over the
  // shoulder's ranges with the elbow straight (shoulder muscles). Throws Error (kArgument) that
  // names what in the description is wrong.
  explicit ExoPlant(const ExoScene& scene);

  // A user's own MJCF file; there is no nominal model then. Throws Error: kFile, kFormat.
  static ExoPlant from_file(const std::string& path, const EngineRoom& room = {});

  // A model whose text was written elsewhere, on the bodies of a scene. There is no nominal model.
  static ExoPlant written(EngineModel model, std::string text, const ExoScene& scene);

  const EngineModel& model() const noexcept { return model_; }
  const std::string& text() const noexcept { return text_; }  // MJCF; "" for a file

  // The plant with other numbers (see ModelQuantity). Its nominal model is dropped, because it was
  // made from the description: change the description to have both.
  ExoPlant changed(const std::vector<Change>& changes) const;

  // What it was made from; throws Error (kUnsupported) like nominal().
  const ExoScene& scene() const;

  // The description that it was made from, before changes, to draw it by; NULL for a file.
  const ExoScene* described() const noexcept { return scene_.get(); }

  bool has_nominal() const noexcept { return nominal_ != nullptr; }
  const RigidTree& nominal() const;  // throws Error (kUnsupported) where there is none

  // Nominal torque at each joint for a motion, (6) and (20) of Tesfazgi 2023: M a + c + g, and with
  // `friction` also damping and Coulomb friction (0 at rest). N m.
  Vector inverse_dynamics(const VectorRef& angle, const VectorRef& rate,
                          const VectorRef& acceleration, bool friction) const;
  Vector friction_torque(const VectorRef& rate) const;

  // Throws Error (kArgument) that names the joint and its range unless every angle is inside it.
  void check_start(const VectorRef& angle) const;

 private:
  // unranged: the scene's text before length ranges are known.
  ExoPlant(const ExoScene& scene, const std::string& unranged);
  ExoPlant(EngineModel model, std::string text)
      : model_(std::move(model)), text_(std::move(text)) {}

  EngineModel model_;
  std::string text_;
  std::shared_ptr<const ExoScene> scene_;
  std::shared_ptr<const RigidTree> nominal_;
};

}  // namespace ulna
