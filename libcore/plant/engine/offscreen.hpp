// OpenGL without a window, for pictures: EGL where there is one, else OSMesa. Both are looked for
// when the first picture is asked for and never linked, so that nothing else needs them.
#pragma once

#include <memory>
#include <string>

namespace ulna::engine {

enum class OffscreenKind { kAny, kEgl, kOsmesa };

// Names that the dynamic loader looks for.
struct OffscreenLibraries {
  std::string egl = "libEGL.so.1";
  std::string osmesa = "libOSMesa.so.8";
};

class OffscreenContext {
 public:
  // Throws Error (kUnsupported) that says what is missing and which packages have it. The engine
  // finds OpenGL's functions once for a process, so all contexts of a process are of one kind;
  // other names of libraries are for tests of what happens without them.
  static std::unique_ptr<OffscreenContext> open(OffscreenKind kind = OffscreenKind::kAny,
                                                const OffscreenLibraries& libraries = {});

  OffscreenContext() = default;
  virtual ~OffscreenContext() = default;
  OffscreenContext(const OffscreenContext&) = delete;
  OffscreenContext& operator=(const OffscreenContext&) = delete;

  // "EGL, llvmpipe (LLVM 15.0.6, 256 bits)"
  const std::string& words() const { return words_; }

  // Makes the context the calling thread's own as long as it lives, and puts the former one back.
  // Throws Error (kInternal) when another thread holds it.
  class Use {
   public:
    explicit Use(OffscreenContext& context) : context_(context) { context_.enter(); }
    ~Use() { context_.leave(); }
    Use(const Use&) = delete;
    Use& operator=(const Use&) = delete;

   private:
    OffscreenContext& context_;
  };

 protected:
  virtual void enter() = 0;
  virtual void leave() noexcept = 0;

  std::string words_;
};

}  // namespace ulna::engine
