#include "impedance/structure.hpp"

namespace ulna {
namespace {

enum class Shape { kNone, kScalar, kSymmetric, kFull };

struct Shapes {
  Shape of[3];  // M, B, K
};

Shapes shapes_of(const Structure& structure) {
  const Shape usual = structure.model == Model::kFree ? Shape::kFull : Shape::kSymmetric;
  return {{structure.diagonal_mass ? Shape::kScalar : usual,
           structure.no_damping ? Shape::kNone : usual, usual}};
}

Index parameters(Shape shape, Index n) {
  switch (shape) {
    case Shape::kNone:
      return 0;
    case Shape::kScalar:
      return 1;
    case Shape::kSymmetric:
      return n * (n + 1) / 2;
    case Shape::kFull:
      return n * n;
  }
  return 0;
}

}  // namespace

Matrix structure_map(const Structure& structure, Index n) {
  const Shapes shapes = shapes_of(structure);
  const Index p = 3 * n + 1;
  Index k = n;
  for (const Shape shape : shapes.of) k += parameters(shape, n);
  Matrix map = Matrix::Zero(p * n, k);
  Index at = 0;
  for (Index term = 0; term < 3; ++term) {
    const auto entry = [&](Index row, Index column) { return row * p + term * n + column; };
    switch (shapes.of[term]) {
      case Shape::kNone:
        break;
      case Shape::kScalar:
        for (Index i = 0; i < n; ++i) map(entry(i, i), at) = 1.0;
        ++at;
        break;
      case Shape::kSymmetric:
        for (Index j = 0; j < n; ++j) {
          for (Index i = j; i < n; ++i, ++at) map(entry(i, j), at) = map(entry(j, i), at) = 1.0;
        }
        break;
      case Shape::kFull:
        for (Index j = 0; j < n; ++j) {
          for (Index i = 0; i < n; ++i, ++at) map(entry(i, j), at) = 1.0;
        }
        break;
    }
  }
  for (Index i = 0; i < n; ++i) map(i * p + 3 * n, at++) = 1.0;
  return map;
}

std::vector<Cone> structure_cones(const Structure& structure, Index n) {
  std::vector<Cone> cones;
  Index at = 0;
  for (const Shape shape : shapes_of(structure).of) {
    const Index size = shape == Shape::kSymmetric ? n : shape == Shape::kScalar ? 1 : 0;
    if (size > 0) cones.push_back({at, size});
    at += parameters(shape, n);
  }
  return cones;
}

}  // namespace ulna
