#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <optional>
#include <set>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "rotodom/averaging/averaging.h"

namespace rotslam {

/// An edge and the keypoints it rests on.
struct SupportedEdge {
  RelativeRotation edge;
  // Indices of the matched keypoints in frames edge.i and edge.j, inliers only. Empty when they are
  // not known; the edge's error then counts as independent of all others.
  std::span<const std::array<int, 2>> keypoint_pairs;
};

/// Computes the covariances of orientations relative to the first view, frame by frame alongside
/// `AverageRotations`.
///
/// The averaged orientations of a window are, to first order, a linear function of the errors of
/// the anchors and of the edges. Their covariance follows from those two ("sandwich" estimator). It
/// differs from the inverse of the normal equations in four ways:
/// - Edges share noise. Half of an edge's covariance comes from the keypoint noise in either frame;
///   two edges with a common frame share the noise of their common keypoints. Along a track the
///   noise of the frames in between cancels; over several edges of one frame it does not average
///   out.
/// - Tracked patches slide slowly. This error accumulates at a slowly changing rate, so that edges
///   over the same or neighbouring frames share it, and along a track it adds up
///   (AveragingOptions::lasting_share).
/// - Weights of the robust loss and edge_floor_deg determine the influence of an edge, not its
///   error.
/// - Anchors are uncertain, and correlated with each other and with their edges. A view that leaves
///   the window keeps its covariance and its part in the edges that are kept.
/// Memory and time do not depend on the length of the sequence: a fixed view is dropped once it has
/// had no new edge for the length of a window.
/// Cost:    0.05 ms a frame at 10 free views with 5 edges each, the covariances of the newest view
///          and of the one that leaves the window included (tests/bench/averaging_bench.cc); 0.2 ms
///          on real sequences, whose edges have more points in common.
/// Error:   mean squared Mahalanobis distance / 3 within 0.5 to 2 on worlds of points and on graphs
///          with independent errors, edge_error_factor 1 and lasting_share 0
///          (orientation_covariance_test.cc); with the defaults 0.5 to 2.2 on rendered streets,
///          rooms and gimbals, means of three seeds (tests/bench/odometry_accuracy.cc).
class OrientationCovariance {
 public:
  /// Throws std::invalid_argument when an option is out of range.
  explicit OrientationCovariance(const AveragingOptions& options);

  /// Adds a new view after the orientations have been averaged.
  /// @param edges           new edges of `view` to older views; with averaging off the one edge
  ///                        that it is chained to. Edges to dropped views are ignored.
  /// @param cam_from_world  averaged orientations.
  /// @param free_views      the averaged views; with mode global the newest options.window views,
  ///                        with mode off `view` alone.
  /// The orientation of a view without an edge, other than the first one, is unknown.
  void AddView(FrameId view,
               std::span<const SupportedEdge> edges,
               const RotationMap& cam_from_world,
               const std::set<FrameId>& free_views);

  /// False for a dropped view. AddView needs the orientations of all others.
  bool Holds(FrameId view) const { return SlotOf(view) >= 0; }

  /// Covariance of the error delta in `Exp(delta) * cam_from_world` of a view, rad^2, in the
  /// camera's frame; nullopt for a dropped view. It belongs to the orientation after the last
  /// AddView.
  std::optional<Eigen::Matrix3d> Of(FrameId view) const;

  /// Covariance of the error delta in `Exp(delta) * j_from_i` of the rotation between two views,
  /// rad^2, in the frame of camera j; their common error cancels. Otherwise as Of().
  std::optional<Eigen::Matrix3d> Between(FrameId i, FrameId j) const;

  /// Saves or restores the state, except the options (rotodom/types/archive.h).
  template <class Archive>
  void Transfer(Archive& archive) {
    archive(num_added_, view_capacity_, views_, edges_, anchor_covariance_, gains_);
    archive(system_edges_, lasting_integrals_, normal_root_);
  }

 private:
  struct View {
    FrameId id;
    bool is_used = false;     // unused slots are used again
    int number = 0;           // 1 for the first view ever, and so on
    bool is_settled = false;  // fixed; its rows of the covariance and gains are final
    int last_edge = 0;        // number of the view that brought its last new edge
    int position = -1;        // among the free views of the system, -1 when fixed
    Eigen::Matrix3d R_c_w = Eigen::Matrix3d::Identity();

    template <class Archive>
    void Transfer(Archive& archive) {
      archive(id, is_used, number, is_settled, last_edge, position, R_c_w);
    }
  };
  struct Shared {
    int edge = 0;
    double share = 0.0;  // correlation of the two whitened errors, times two

    template <class Archive>
    void Transfer(Archive& archive) {
      archive(edge, share);
    }
  };
  struct Edge {
    bool is_used = false;
    int i = 0;  // slots of its views, -1 when dropped
    int j = 0;
    Rotation j_from_i;
    Eigen::Matrix3d covariance_in_j = Eigen::Matrix3d::Zero();
    // Symmetric square root of half its covariance, in the world's frame.
    Eigen::Matrix3d root = Eigen::Matrix3d::Zero();
    int begin = 0;  // numbers of its views
    int end = 0;
    int num_keypoints = 0;
    std::vector<std::uint64_t> keypoints_i;  // as bits
    std::vector<std::uint64_t> keypoints_j;
    std::vector<Shared> shared;                           // itself first
    Eigen::Matrix3d curvature = Eigen::Matrix3d::Zero();  // its weight in the system

    template <class Archive>
    void Transfer(Archive& archive) {
      archive(is_used, i, j, j_from_i, covariance_in_j, root, begin, end, num_keypoints);
      archive(keypoints_i, keypoints_j, shared, curvature);
    }
  };
  // The error of one view as a linear function of those of anchors and edges.
  struct Row {
    std::vector<Eigen::Matrix3d> from_anchor;  // by view slot
    std::vector<Eigen::Matrix3d> gain;         // by edge slot: of the whitened error, directly
    std::vector<Eigen::Matrix3d> inherited;    // and by way of the anchors
    std::vector<Eigen::Matrix3d> pull;         // covariance of the direct part with each error
  };

  Row RowOf(int view) const;
  Eigen::Matrix3d Covariance(const Row& a, const Row& b) const;
  void Settle(int view);
  int SlotOf(FrameId view) const;
  int NewView(FrameId view);
  void AddEdge(const SupportedEdge& supported, const RotationMap& cam_from_world);
  double Share(const Edge& a, const Edge& b);
  // Covariance of the sliding errors of two edges, whose rate has the correlation exp(-|t| /
  // lasting_views).
  double LastingCorrelation(const Edge& a, const Edge& b);
  // Second integral of the rate's correlation at this distance.
  double LastingIntegral(int views);
  void DropOldViews();
  void BuildSystem(const RotationMap& cam_from_world, const std::set<FrameId>& free_views);
  Eigen::Matrix3d& Gain(int view, int edge) { return gains_[edge * view_capacity_ + view]; }
  const Eigen::Matrix3d& Gain(int view, int edge) const {
    return gains_[edge * view_capacity_ + view];
  }

  AveragingOptions options_;
  int num_added_ = 0;
  int view_capacity_ = 0;
  std::vector<View> views_;
  std::vector<Edge> edges_;
  std::vector<Eigen::Matrix3d> anchor_covariance_;  // view_capacity_ squared, fixed views
  std::vector<Eigen::Matrix3d> gains_;  // errors of fixed views from whitened edge errors
  std::vector<int> system_edges_;
  std::vector<double> lasting_integrals_;  // by distance, as far as needed
  Eigen::MatrixXd normal_root_;            // Cholesky factor of the present system
};

}  // namespace rotslam
