#include "plant/engine/offscreen.hpp"

#include <dlfcn.h>

#include <array>
#include <cstdint>
#include <cstring>
#include <mutex>
#include <optional>
#include <utility>
#include <vector>

#include "base/error.hpp"

namespace ulna::engine {
namespace {

constexpr const char* kEglPackages = "libegl1 and libegl-mesa0";
constexpr const char* kOsmesaPackages = "libosmesa6";
constexpr unsigned kGlRenderer = 0x1F01;

using GlGetString = const unsigned char* (*)(unsigned);

// A library of the dynamic loader. It is given back only where nothing of it was used: OpenGL
// drivers do not survive being unloaded.
class GlLibrary {
 public:
  explicit GlLibrary(const std::string& name)
      : name_(name), handle_(name.empty() ? nullptr : dlopen(name.c_str(), RTLD_NOW)) {}
  ~GlLibrary() {
    if (handle_ != nullptr && !kept_) dlclose(handle_);
  }
  GlLibrary(const GlLibrary&) = delete;
  GlLibrary& operator=(const GlLibrary&) = delete;

  bool there() const { return handle_ != nullptr; }
  void keep() { kept_ = true; }

  template <class Function>
  void find(Function& function, const char* symbol) const {
    void* address = dlsym(handle_, symbol);
    if (address == nullptr) {
      throw Error(Fault::kUnsupported, "",
                  "the library " + name_ + " has no " + symbol + ", so pictures cannot be drawn");
    }
    static_assert(sizeof function == sizeof address);
    std::memcpy(&function, &address, sizeof address);
  }

 private:
  std::string name_;
  void* handle_;
  bool kept_ = false;
};

template <class Function>
void from_address(Function& function, void* address) {
  std::memcpy(&function, &address, sizeof address);
}

// EGL ---------------------------------------------------------------------------------------------

// Of <EGL/egl.h> and its extensions, which the build does not need this way.
using EglHandle = void*;
using EglInt = std::int32_t;
constexpr EglInt kEglNone = 0x3038;
constexpr unsigned kEglOpenGlApi = 0x30A2;
constexpr unsigned kEglPlatformDevice = 0x313F;
constexpr unsigned kEglPlatformSurfaceless = 0x31DD;
constexpr EglInt kEglDraw = 0x3059;
constexpr EglInt kEglRead = 0x305A;

struct Egl {
  EglHandle (*get_display)(void*) = nullptr;
  unsigned (*initialize)(EglHandle, EglInt*, EglInt*) = nullptr;
  unsigned (*bind_api)(unsigned) = nullptr;
  unsigned (*query_api)() = nullptr;
  unsigned (*choose_config)(EglHandle, const EglInt*, EglHandle*, EglInt, EglInt*) = nullptr;
  EglHandle (*create_context)(EglHandle, EglHandle, EglHandle, const EglInt*) = nullptr;
  unsigned (*destroy_context)(EglHandle, EglHandle) = nullptr;
  EglHandle (*create_surface)(EglHandle, EglHandle, const EglInt*) = nullptr;
  unsigned (*destroy_surface)(EglHandle, EglHandle) = nullptr;
  unsigned (*make_current)(EglHandle, EglHandle, EglHandle, EglHandle) = nullptr;
  EglHandle (*current_context)() = nullptr;
  EglHandle (*current_display)() = nullptr;
  EglHandle (*current_surface)(EglInt) = nullptr;
  void* (*proc_address)(const char*) = nullptr;

  explicit Egl(const GlLibrary& library) {
    library.find(get_display, "eglGetDisplay");
    library.find(initialize, "eglInitialize");
    library.find(bind_api, "eglBindAPI");
    library.find(query_api, "eglQueryAPI");
    library.find(choose_config, "eglChooseConfig");
    library.find(create_context, "eglCreateContext");
    library.find(destroy_context, "eglDestroyContext");
    library.find(create_surface, "eglCreatePbufferSurface");
    library.find(destroy_surface, "eglDestroySurface");
    library.find(make_current, "eglMakeCurrent");
    library.find(current_context, "eglGetCurrentContext");
    library.find(current_display, "eglGetCurrentDisplay");
    library.find(current_surface, "eglGetCurrentSurface");
    library.find(proc_address, "eglGetProcAddress");
  }

  // Graphics cards first, then software without a window system, then whatever is the default.
  std::vector<EglHandle> displays() const {
    std::vector<EglHandle> found;
    EglHandle (*platform_display)(unsigned, void*, const EglInt*) = nullptr;
    unsigned (*query_devices)(EglInt, EglHandle*, EglInt*) = nullptr;
    from_address(platform_display, proc_address("eglGetPlatformDisplayEXT"));
    from_address(query_devices, proc_address("eglQueryDevicesEXT"));
    if (platform_display != nullptr && query_devices != nullptr) {
      std::array<EglHandle, 16> devices{};
      EglInt count = 0;
      if (query_devices(static_cast<EglInt>(devices.size()), devices.data(), &count) == 0) {
        count = 0;
      }
      for (EglInt i = 0; i < count; ++i) {
        found.push_back(
            platform_display(kEglPlatformDevice, devices[static_cast<std::size_t>(i)], nullptr));
      }
    }
    if (platform_display != nullptr) {
      found.push_back(platform_display(kEglPlatformSurfaceless, nullptr, nullptr));
    }
    found.push_back(get_display(nullptr));
    return found;
  }
};

class EglContext final : public OffscreenContext {
 public:
  // Nothing where the display draws no OpenGL.
  static std::unique_ptr<EglContext> on(std::shared_ptr<const Egl> egl, EglHandle display) {
    if (display == nullptr || egl->initialize(display, nullptr, nullptr) == 0) return nullptr;
    const unsigned former = egl->query_api();
    if (egl->bind_api(kEglOpenGlApi) == 0) return nullptr;
    auto context = std::unique_ptr<EglContext>(new EglContext(egl, display));
    const bool made = context->make();
    egl->bind_api(former);
    return made ? std::move(context) : nullptr;
  }

  // Displays are left open: closing one would close it for the whole process.
  ~EglContext() override {
    if (surface_ != nullptr) egl_->destroy_surface(display_, surface_);
    if (context_ != nullptr) egl_->destroy_context(display_, context_);
  }

 private:
  EglContext(std::shared_ptr<const Egl> egl, EglHandle display)
      : egl_(std::move(egl)), display_(display) {}

  bool make() {
    // Of a surface of 24 bits with depth that OpenGL can draw on; it is never drawn on.
    const EglInt wanted[] = {0x3033, 0x0001, 0x3040, 0x0008, 0x3024, 8,       0x3023,
                             8,      0x3022, 8,      0x3025, 24,     kEglNone};
    EglHandle config = nullptr;
    EglInt count = 0;
    if (egl_->choose_config(display_, wanted, &config, 1, &count) == 0 || count < 1) return false;
    context_ = egl_->create_context(display_, config, nullptr, nullptr);
    const EglInt size[] = {0x3057, 16, 0x3056, 16, kEglNone};
    surface_ = egl_->create_surface(display_, config, size);
    if (context_ == nullptr || surface_ == nullptr) return false;
    try {
      const Use use(*this);
      GlGetString get_string = nullptr;
      from_address(get_string, egl_->proc_address("glGetString"));
      const unsigned char* name = get_string == nullptr ? nullptr : get_string(kGlRenderer);
      if (name == nullptr) return false;
      words_ = std::string("EGL, ") + reinterpret_cast<const char*>(name);
    } catch (const Error&) {
      return false;
    }
    return true;
  }

  void enter() override {
    former_api_ = egl_->query_api();
    egl_->bind_api(kEglOpenGlApi);
    former_display_ = egl_->current_display();
    former_context_ = egl_->current_context();
    former_draw_ = egl_->current_surface(kEglDraw);
    former_read_ = egl_->current_surface(kEglRead);
    if (egl_->make_current(display_, surface_, surface_, context_) != 0) return;
    egl_->bind_api(former_api_);
    throw Error(
        Fault::kInternal, "",
        "the OpenGL context could not be entered: a renderer can be used by one thread at a time");
  }

  void leave() noexcept override {
    if (former_context_ == nullptr) {
      egl_->make_current(display_, nullptr, nullptr, nullptr);
    } else {
      egl_->make_current(former_display_, former_draw_, former_read_, former_context_);
    }
    egl_->bind_api(former_api_);
  }

  std::shared_ptr<const Egl> egl_;
  EglHandle display_;
  EglHandle context_ = nullptr;
  EglHandle surface_ = nullptr;
  unsigned former_api_ = 0;
  EglHandle former_display_ = nullptr, former_context_ = nullptr;
  EglHandle former_draw_ = nullptr, former_read_ = nullptr;
};

// OSMesa ------------------------------------------------------------------------------------------

struct Osmesa {
  void* (*create)(unsigned, int, int, int, void*) = nullptr;
  void (*destroy)(void*) = nullptr;
  unsigned char (*make_current)(void*, void*, unsigned, int, int) = nullptr;
  void* (*current)() = nullptr;
  void* (*proc_address)(const char*) = nullptr;

  explicit Osmesa(const GlLibrary& library) {
    library.find(create, "OSMesaCreateContextExt");
    library.find(destroy, "OSMesaDestroyContext");
    library.find(make_current, "OSMesaMakeCurrent");
    library.find(current, "OSMesaGetCurrentContext");
    library.find(proc_address, "OSMesaGetProcAddress");
  }
};

class OsmesaContext final : public OffscreenContext {
 public:
  explicit OsmesaContext(std::shared_ptr<const Osmesa> osmesa) : osmesa_(std::move(osmesa)) {
    constexpr unsigned kRgba = 0x1908;
    context_ = osmesa_->create(kRgba, 24, 8, 0, nullptr);
    if (context_ == nullptr) {
      throw Error(Fault::kMemory, "", "OSMesa gave no context: there is not enough memory");
    }
    const Use use(*this);
    GlGetString get_string = nullptr;
    from_address(get_string, osmesa_->proc_address("glGetString"));
    words_ = std::string("OSMesa, ") + reinterpret_cast<const char*>(get_string(kGlRenderer));
  }
  ~OsmesaContext() override { osmesa_->destroy(context_); }

 private:
  void enter() override {
    constexpr unsigned kUnsignedByte = 0x1401;
    if (osmesa_->make_current(context_, pixels_.data(), kUnsignedByte, 16, 16) != 0) return;
    throw Error(Fault::kInternal, "", "the OpenGL context could not be entered");
  }
  void leave() noexcept override { osmesa_->make_current(nullptr, nullptr, 0, 0, 0); }

  std::shared_ptr<const Osmesa> osmesa_;
  void* context_ = nullptr;
  std::array<unsigned char, 16 * 16 * 4> pixels_{};  // never drawn on, but it must be there
};

// Choice ------------------------------------------------------------------------------------------

// What the process draws with, once something was drawn.
struct Chosen {
  std::shared_ptr<const Egl> egl;
  EglHandle display = nullptr;
  std::shared_ptr<const Osmesa> osmesa;
};

std::mutex& choice_mutex() {
  static std::mutex mutex;
  return mutex;
}

std::optional<Chosen>& chosen() {
  static std::optional<Chosen> choice;
  return choice;
}

std::unique_ptr<OffscreenContext> again(const Chosen& c, OffscreenKind kind) {
  const bool wrong =
      c.egl != nullptr ? kind == OffscreenKind::kOsmesa : kind == OffscreenKind::kEgl;
  if (wrong) {
    throw Error(
        Fault::kUnsupported, "backend",
        std::string("this process draws with ") + (c.egl != nullptr ? "EGL" : "OSMesa") +
            " already, and the engine cannot change it: choose the other one in a new process");
  }
  if (c.osmesa != nullptr) return std::make_unique<OsmesaContext>(c.osmesa);
  std::unique_ptr<OffscreenContext> context = EglContext::on(c.egl, c.display);
  if (context != nullptr) return context;
  throw Error(Fault::kMemory, "", "EGL gave no further context: there is not enough memory");
}

std::unique_ptr<OffscreenContext> try_egl(const std::string& name, std::string& missing) {
  GlLibrary library(name);
  if (!library.there()) {
    missing = std::string("EGL is not there (Debian packages ") + kEglPackages + ")";
    return nullptr;
  }
  const auto egl = std::make_shared<const Egl>(library);
  for (const EglHandle display : egl->displays()) {
    std::unique_ptr<OffscreenContext> context = EglContext::on(egl, display);
    if (context == nullptr) continue;
    library.keep();
    chosen() = Chosen{egl, display, nullptr};
    return context;
  }
  missing = "EGL offers no OpenGL (Debian packages libegl-mesa0 and libgl1-mesa-dri)";
  return nullptr;
}

std::unique_ptr<OffscreenContext> try_osmesa(const std::string& name, std::string& missing) {
  GlLibrary library(name);
  if (!library.there()) {
    missing = std::string("OSMesa is not there (Debian package ") + kOsmesaPackages + ")";
    return nullptr;
  }
  const auto osmesa = std::make_shared<const Osmesa>(library);
  auto context = std::make_unique<OsmesaContext>(osmesa);
  library.keep();
  chosen() = Chosen{nullptr, nullptr, osmesa};
  return context;
}

}  // namespace

std::unique_ptr<OffscreenContext> OffscreenContext::open(OffscreenKind kind,
                                                         const OffscreenLibraries& libraries) {
  const std::lock_guard lock(choice_mutex());
  const OffscreenLibraries usual;
  const bool named = libraries.egl != usual.egl || libraries.osmesa != usual.osmesa;
  if (chosen().has_value() && !named) return again(*chosen(), kind);
  std::string no_egl, no_osmesa;
  std::unique_ptr<OffscreenContext> context;
  if (kind != OffscreenKind::kOsmesa) context = try_egl(libraries.egl, no_egl);
  if (context == nullptr && kind != OffscreenKind::kEgl) {
    context = try_osmesa(libraries.osmesa, no_osmesa);
  }
  if (context != nullptr) return context;
  const std::string both = no_egl.empty()      ? no_osmesa
                           : no_osmesa.empty() ? no_egl
                                               : no_egl + " and " + no_osmesa;
  throw Error(
      Fault::kUnsupported, "backend",
      "pictures need OpenGL without a window: " + both + "; everything else works without it");
}

}  // namespace ulna::engine
