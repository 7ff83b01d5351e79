#pragma once

#include <concepts>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <typeinfo>
#include <variant>
#include <vector>

#include "fontcore/compact.h"
#include "fontcore/contour.h"
#include "fontcore/representation.h"
#include "fontcore/splice.h"

namespace fontcore {

// What must go on holding on a linked curve, whatever tool changes it. Every rule claims a place or a stretch of t, and
// may move the curve within its control interval to come true again.

/// A stretch that does not change, bit for bit in every representation that has it.
struct Frozen {
  Interval interval;
};
/// The curve passes a point.
struct HeldPoint {
  double t = 0.0;
  Point p = Point::Zero();
  double control = 0.05;  ///< of t, on either side
};
/// The curve has a corner at a point, arriving and leaving in given directions (any length above 0).
struct HeldCorner {
  double t = 0.0;
  Point p = Point::Zero();
  Point in = Point::Zero();
  Point out = Point::Zero();
  double control = 0.05;  ///< of t, on either side
};
/// A stretch that is a straight line between wherever its ends are.
struct HeldLine {
  Interval interval;
};
/// The enclosed area, of the Bezier form, is a value: given back within what a change touched.
struct HeldArea {
  double area = 0.0;  ///< signed
};
/// What happens to a change that would make the curve cross itself where it did not.
struct NoAddedCrossing {
  enum class Otherwise { Reduce, Refuse } otherwise = Otherwise::Reduce;
};

/// A rule and the name that reports show.
struct CurveRule {
  std::string name;
  std::variant<Frozen, HeldPoint, HeldCorner, HeldLine, HeldArea, NoAddedCrossing> rule;
};

/// What the change that made a value came to.
struct LinkedReport {
  double share = 1.0;  ///< of the change that was kept: below 1 if less of it adds no crossing, 0 if it was refused
  int rounds = 0;      ///< how often the rules were gone through: 1 but for crossings
  int added_crossings = 0;        ///< that the change as asked for would have made, if that was looked at
  double area_error = 0.0;        ///< relative, if an area is held and could not be met
  std::vector<Interval> changed;  ///< disjoint
  std::string refused;            ///< why, in one line; empty as a rule
};

struct LinkedOptions {
  double epsilon = 0.5;            ///< largest distance between two representations at equal t, font units
  int spline_degree = 3;           ///< of the B-spline, 1 to 5
  double corner_angle = 0.139626;  ///< sharper turns of the contour are corners, radians (8 degrees)
};

/// One closed curve over t in [0, 1) in several forms, kept within epsilon of each other at every t.
///
/// A tool reads the form it likes, changes it, and gives it back with the intervals that it changed, or gives splices;
/// the rules re-establish themselves; a new curve comes out, and the old value is the undo. A form is brought up to
/// date when it is read: stretches that others changed since are sampled from the one that is, and spliced in; outside
/// them it stays bit for bit.
///
/// A value: copies cost a few pointers, and what two of them have in common is shared. Reading remembers what it
/// brought up to date, so one object must not be read from two threads at once; copies may.
///
/// Units   font units; t modulo 1.
/// Exact   two forms that are up to date are within epsilon at every t. The form last changed is the curve.
/// Source  [GA98] section 4.
class LinkedCurve {
 public:
  /// Throws  InvalidInput if epsilon is not positive, the degree not in [1, 5], or the contour has no length.
  explicit LinkedCurve(const BezierContour& contour, const LinkedOptions& options = {});
  /// A curve that begins as a polyline; corners are where it turns by more than the corner angle.
  explicit LinkedCurve(const Polyline& polyline, const LinkedOptions& options = {});

  double epsilon() const;
  const LinkedOptions& options() const;

  // The forms, brought up to date. References live until this object is assigned to or destroyed, or reads again.
  const LinkedBezier& bezier() const { return read<LinkedBezier>(); }
  const LinkedPolyline& polyline() const { return read<LinkedPolyline>(); }
  const LinkedSpline& spline() const { return read<LinkedSpline>(); }
  /// Periodic, across corners.
  const LinkedWavelet& wavelet() const;
  /// Arcwise, between the corners there were when it was first read; periodic if there are fewer than two.
  const LinkedWavelet& arcwise() const;
  /// A form of a type of one's own, added by `with_form`.
  /// Throws  InvalidInput if there is none.
  template <std::derived_from<Representation> Form>
  const Form& read() const {
    return dynamic_cast<const Form&>(read_slot(slot_of(typeid(Form))));
  }
  /// A further form, read from the others when it is asked for first; `empty` says what it is and needs hold no curve.
  template <std::derived_from<Representation> Form>
  LinkedCurve with_form(const Form& empty) const {
    return with_slot(std::make_shared<const Form>(empty));
  }
  /// What of a form is not up to date; everything if it was never read.
  template <std::derived_from<Representation> Form>
  std::vector<Interval> stale() const {
    return stale_in(slot_of(typeid(Form)));
  }

  /// The curve over an interval, from the form that is the curve.
  SampledSplice sample(const Interval& interval, double tolerance) const;
  SampledSplice sample(const Interval& interval) const { return sample(interval, sampling_share * 0.5 * epsilon()); }

  /// The curve with splices put in, in order, and all rules holding again. Corners strictly inside a splice go unless a
  /// pin says that one is there.
  /// Throws  InvalidInput as `require_valid`.
  LinkedCurve with_splices(std::vector<SampledSplice> splices) const;
  LinkedCurve with_splice(SampledSplice splice) const { return with_splices({std::move(splice)}); }
  /// The curve as one of its forms was changed, outside the intervals like the form that was read; all rules holding
  /// again. Corners stay.
  /// Throws  InvalidInput if there is no form of that type.
  template <std::derived_from<Representation> Form>
  LinkedCurve with(const Form& form, const std::vector<Interval>& changed) const {
    return with_changed(slot_of(typeid(Form)), std::make_shared<const Form>(form), changed);
  }
  template <std::derived_from<Representation> Form>
  LinkedCurve with(const Changed<Form>& changed) const {
    return with(changed.form, {changed.interval});
  }
  /// As above, for the two forms that are of one type.
  LinkedCurve with_wavelet(const Changed<LinkedWavelet>& changed) const;
  LinkedCurve with_arcwise(const Changed<LinkedWavelet>& changed) const;
  /// What the change that made this value came to.
  const LinkedReport& report() const { return report_; }

  // Rules: part of the value.

  const std::vector<CurveRule>& rules() const;
  /// The curve with one more rule, moved where it must be for it to hold.
  /// Throws  InvalidInput if a number is out of range or not finite, or the name is taken; UnsatisfiableConstraints,
  ///         naming both, if another rule claims the same place: points and corners at one t, or inside a line; two
  ///         lines that overlap; what is frozen and would have to move; two areas; two rules on crossings.
  LinkedCurve with_rule(CurveRule rule) const;
  /// Throws  InvalidInput if there is no rule of that name.
  LinkedCurve without_rule(const std::string& name) const;

  /// Frozen stretches, merged; frozen and thawed piece by piece, as with a brush. Their rules have no names of their
  /// own.
  std::vector<Interval> frozen() const;
  LinkedCurve with_frozen(const Interval& interval) const;
  LinkedCurve without_frozen(const Interval& interval) const;

  /// Where tangents may jump, ascending; those of rules too.
  std::vector<double> corners() const;
  LinkedCurve with_corner(double t) const;     ///< that may be one; the curve stays
  LinkedCurve without_corner(double t) const;  ///< of those within 1e-9; the curve stays until it is changed there

  /// The marked stretch: if there is one, nothing outside it changes.
  const std::optional<Interval>& marks() const;
  LinkedCurve with_marks(std::optional<Interval> marks) const;

  /// Fewer pieces: the Bezier form made compact within a distance, by `fit_compact` with `Coordinates::Any`. Frozen
  /// stretches and everything outside the marks stay bit for bit; corners and held points stay nodes at their t.
  /// Throws  InvalidInput if the tolerance is negative or not finite.
  LinkedCurve compacted(double tolerance) const;

  /// Bytes held by this value that an older one does not hold too.
  std::size_t bytes_beyond(const LinkedCurve& older) const;

 private:
  struct Slot {
    std::shared_ptr<const Representation> form;
    IntervalSet stale;
  };
  struct Rules;  // and corners, marks, options

  void add_slots();
  std::size_t slot_of(const std::type_info& type) const;
  const Representation& read_slot(std::size_t slot) const;
  std::vector<Interval> stale_in(std::size_t slot) const { return slots_[slot].stale.intervals(); }
  LinkedCurve with_slot(std::shared_ptr<const Representation> empty) const;
  /// A stretch of the curve for forms to take in, with pins where they may turn or must pass.
  SampledSplice handed_over(const Interval& interval) const;
  LinkedCurve with_share(const std::vector<SampledSplice>& splices, double share) const;
  LinkedCurve with_change(const SampledSplice& asked) const;
  void give_back_area(const LinkedCurve& before);
  int added_meetings(const LinkedCurve& after) const;
  LinkedCurve with_changed(std::size_t slot, std::shared_ptr<const Representation> form,
                           const std::vector<Interval>& changed) const;

  mutable std::vector<Slot> slots_;
  std::size_t current_ = 0;  // the slot that is the curve: never stale
  std::shared_ptr<const Rules> rules_;
  LinkedReport report_;
  double area_missing_ = 0.0;  // of the held area, if there is one
};

}  // namespace fontcore
