// CGAL's Efficient RANSAC on a cloud of float32 x, y, z: normals by PCA, then shapes.
//
//   cgal_ransac CLOUD.xyz32 EPSILON CLUSTER_EPSILON MIN_POINTS
//
// Prints how many shapes of each kind were found. It measures no deformations.

#include <CGAL/Exact_predicates_inexact_constructions_kernel.h>
#include <CGAL/Shape_detection/Efficient_RANSAC.h>
#include <CGAL/pca_estimate_normals.h>
#include <CGAL/property_map.h>

#include <cstdlib>
#include <fstream>
#include <iostream>
#include <map>
#include <string>
#include <utility>
#include <vector>

using Kernel = CGAL::Exact_predicates_inexact_constructions_kernel;
using PointWithNormal = std::pair<Kernel::Point_3, Kernel::Vector_3>;
using Points = std::vector<PointWithNormal>;
using PointMap = CGAL::First_of_pair_property_map<PointWithNormal>;
using NormalMap = CGAL::Second_of_pair_property_map<PointWithNormal>;
using Traits = CGAL::Shape_detection::Efficient_RANSAC_traits<Kernel, Points, PointMap, NormalMap>;
using Ransac = CGAL::Shape_detection::Efficient_RANSAC<Traits>;

int main(int argc, char** argv) {
  if (argc != 5) {
    std::cerr << "cgal_ransac CLOUD.xyz32 EPSILON CLUSTER_EPSILON MIN_POINTS\n";
    return 2;
  }
  std::ifstream file(argv[1], std::ios::binary);
  Points points;
  float p[3];
  while (file.read(reinterpret_cast<char*>(p), sizeof p)) {
    points.emplace_back(Kernel::Point_3(p[0], p[1], p[2]), Kernel::Vector_3(0, 0, 0));
  }
  CGAL::pca_estimate_normals<CGAL::Sequential_tag>(
      points, 12, CGAL::parameters::point_map(PointMap()).normal_map(NormalMap()));

  Ransac ransac;
  ransac.set_input(points);
  ransac.add_shape_factory<CGAL::Shape_detection::Plane<Traits>>();
  ransac.add_shape_factory<CGAL::Shape_detection::Cylinder<Traits>>();
  ransac.add_shape_factory<CGAL::Shape_detection::Torus<Traits>>();
  ransac.add_shape_factory<CGAL::Shape_detection::Sphere<Traits>>();
  Ransac::Parameters parameters;
  parameters.epsilon = std::atof(argv[2]);
  parameters.cluster_epsilon = std::atof(argv[3]);
  parameters.min_points = static_cast<std::size_t>(std::atol(argv[4]));
  parameters.normal_threshold = 0.9;
  parameters.probability = 0.01;
  ransac.detect(parameters);

  std::map<std::string, int> count;
  for (const auto& shape : ransac.shapes()) {
    const std::string info = shape->info();
    ++count[info.substr(6, info.find(' ', 6) - 6)];
  }
  for (const auto& [kind, n] : count) std::cout << kind << ' ' << n << '\n';
}
