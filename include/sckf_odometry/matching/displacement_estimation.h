// From aligned scans to a displacement with everything that the filter has to know about its error.
#pragma once

#include <optional>

#include "sckf_odometry/core/displacement.h"
#include "sckf_odometry/matching/alignment_problem.h"
#include "sckf_odometry/matching/decisive_place.h"
#include "sckf_odometry/matching/observability.h"

namespace sckf {

struct EstimationOptions {
  ObservabilityOptions observability;
  int correlated_beams = 15;        ///< residuals of this many neighbouring beams may err together
  double matching_inflation = 2.5;  ///< of what residuals show beyond range noise: they do not show all of it
  double place_size = 0.6;          ///< [m] what stands so close together is a place: it moves, or is mistaken, as one
  double place_std = 0.035;         ///< [m] the place that decides most of the displacement may be off by this
};

/// What a match tells of a constant of the laser that bends what both scans see, the same wall otherwise from each
/// place.
struct ConstantEvidence {
  double value = 0.0;        ///< by how much more of it allowed for the scans would fall together best
  double information = 0.0;  ///< inverse variance as far as range noise goes; 0: it tells nothing
  double bias_std = 0.0;     ///< how far off such values are in the mean of many
};

struct DisplacementEstimate {
  Displacement displacement;
  ConstantEvidence range_offset;    ///< to be added to each range of both scans [m]
  ConstantEvidence sweep_duration;  ///< EvenSweep::duration of both [s]
  DecisivePlace decisive;           ///< the place that decides most of it
};

/// The displacement that solves the problem with its pairs and weights as they are, starting from where the pairs were
/// found; empty if no direction of it is observable. Directions that are not observable keep the start's value.
///
/// With loss Σ ρ(e_i(x, z)), implicit differentiation of its gradient at the minimum gives (method of Censi, ICRA 2007)
///   J = ∂x/∂z = −(∂²L/∂x²)⁻¹ ∂²L/∂x∂z,
/// one column per range of either scan; the ranges that a reference surface was fitted to all have their share.
std::optional<DisplacementEstimate> estimateDisplacement(const AlignmentProblem& problem,
                                                         const SE2& reference_from_current,
                                                         const EstimationOptions& options);

/// The covariance, d × d, of a displacement whose decisive place is off by so much [m] in x and in y: its part of
/// matching_noise. What nothing else confirms may have moved, or be no surface but a few points of what is seen
/// otherwise from each place; residuals show nothing of it, since such a place pulls the displacement onto itself.
Displacement::MatrixDD placeNoise(const Displacement& displacement, const DecisivePlace& place, double std);

/// The mean of a displacement and of that of the same scans with their roles exchanged, both of dimension 3. The same
/// ranges are in both, by Jacobians that add; which points and surfaces are taken together is not the same, and errs
/// less in the mean. What residuals scatter in each is taken for common to both. Their difference d tells of what is
/// left, as a sample of two, d dᵀ / 2: that of either and of the mean, since both begin at the same place.
Displacement meanOfBothWays(const Displacement& reference_from_current, const Displacement& current_from_reference);

}  // namespace sckf
