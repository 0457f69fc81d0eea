// Hear of every motion that OMPL checks and of the configurations that it draws.
#pragma once

#include <limits>
#include <memory>
#include <typeinfo>
#include <utility>

#include <ompl/base/MotionValidator.h>
#include <ompl/base/SpaceInformation.h>
#include <ompl/base/StateSampler.h>
#include <ompl/base/StateSpace.h>
#include <ompl/base/spaces/RealVectorStateSpace.h>
#include <ompl/base/spaces/SE2StateSpace.h>
#include <ompl/base/spaces/SE3StateSpace.h>
#include <ompl/base/spaces/SO2StateSpace.h>

namespace brrt::detail {

namespace ob = ompl::base;

/// Hears what a planner does; from any of its threads.
class Listener {
  public:
    virtual ~Listener() = default;
    virtual void checked(const ob::State *from, const ob::State *to, bool is_free) noexcept = 0;
    virtual void sampled(const ob::State *state) noexcept = 0;
};

/// Who listens at the moment. Planners keep samplers from one solve to the next, beyond the
/// listener.
struct Ear {
    Listener *listener = nullptr;
};
using EarPtr = std::shared_ptr<Ear>;

/// Asks another validator, and tells of it.
class WatchedValidator : public ob::MotionValidator {
  public:
    WatchedValidator(const ob::SpaceInformationPtr &si, ob::MotionValidatorPtr own, EarPtr ear)
        : MotionValidator(si), own_(std::move(own)), ear_(std::move(ear)) {}

    bool checkMotion(const ob::State *from, const ob::State *to) const override {
        return tell(from, to, own_->checkMotion(from, to));
    }
    bool checkMotion(const ob::State *from, const ob::State *to,
                     std::pair<ob::State *, double> &last_valid) const override {
        if (last_valid.first != to) return tell(from, to, own_->checkMotion(from, to, last_valid));
        ob::State *const end = si_->cloneState(to);  // the check writes its result to that end
        const bool is_free = tell(from, end, own_->checkMotion(from, to, last_valid));
        si_->freeState(end);
        return is_free;
    }

  private:
    bool tell(const ob::State *from, const ob::State *to, bool is_free) const {
        if (ear_->listener) ear_->listener->checked(from, to, is_free);
        ++(is_free ? valid_ : invalid_);
        return is_free;
    }

    const ob::MotionValidatorPtr own_;
    const EarPtr ear_;
};

/// A sampler that tells what it drew. It is a sampler of the usual kind itself, and not one around
/// it: that would take a seed of OMPL's generator, so that a recorded run would differ from others.
template <class Usual>
class WatchedSampler : public Usual {
  public:
    WatchedSampler(const ob::StateSpace *space, EarPtr ear) : Usual(space), ear_(std::move(ear)) {}

    void sampleUniform(ob::State *state) override {
        Usual::sampleUniform(state);
        tell(state);
    }
    void sampleUniformNear(ob::State *state, const ob::State *near, double distance) override {
        Usual::sampleUniformNear(state, near, distance);
        tell(state);
    }
    void sampleGaussian(ob::State *state, const ob::State *mean, double deviation) override {
        Usual::sampleGaussian(state, mean, deviation);
        tell(state);
    }

  private:
    void tell(const ob::State *state) const {
        if (ear_->listener) ear_->listener->sampled(state);
    }

    const EarPtr ear_;
};

/// Reads and sets the sampler allocator of a space, which OMPL lets one set only.
class SamplerAllocator : private ob::StateSpace {
  public:
    static ob::StateSamplerAllocator &of(ob::StateSpace &space) {
        return space.*(&SamplerAllocator::ssa_);
    }
};

/// Return what makes the usual samplers of a space, watched; empty for spaces with samplers of
/// their own.
inline ob::StateSamplerAllocator watched_sampler(const ob::StateSpace &space, const EarPtr &ear) {
    const auto is = [&](const auto &...kind) { return ((typeid(space) == kind) || ...); };
    if (is(typeid(ob::RealVectorStateSpace)))
        return [ear](const ob::StateSpace *of) -> ob::StateSamplerPtr {
            return std::make_shared<WatchedSampler<ob::RealVectorStateSampler>>(of, ear);
        };
    if (is(typeid(ob::SO2StateSpace)))
        return [ear](const ob::StateSpace *of) -> ob::StateSamplerPtr {
            return std::make_shared<WatchedSampler<ob::SO2StateSampler>>(of, ear);
        };
    if (is(typeid(ob::CompoundStateSpace), typeid(ob::SE2StateSpace), typeid(ob::SE3StateSpace)))
        return [ear](const ob::StateSpace *of) -> ob::StateSamplerPtr {  // as OMPL makes it
            const auto *whole = of->as<ob::CompoundStateSpace>();
            const auto sampler =
                std::make_shared<WatchedSampler<ob::CompoundStateSampler>>(of, ear);
            double sum = 0;
            for (unsigned i = 0; i < whole->getSubspaceCount(); ++i)
                sum += whole->getSubspaceWeight(i);
            for (unsigned i = 0; i < whole->getSubspaceCount(); ++i) {
                const bool weighed = sum >= std::numeric_limits<double>::epsilon();
                sampler->addSampler(whole->getSubspace(i)->allocStateSampler(),
                                    weighed ? whole->getSubspaceWeight(i) / sum : 1.0);
            }
            return sampler;
        };
    return {};
}

/// Puts a watched validator and sampler into a space, and puts the old ones back. The space stays
/// set up: setting it up anew would draw random numbers for its projections.
class Watch {
  public:
    Watch(const ob::SpaceInformationPtr &si, const EarPtr &ear, bool samples)
        : si_(si), validator_(si->getMotionValidator()) {
        auto &allocator = SamplerAllocator::of(*si->getStateSpace());
        si->getMotionValidator() = std::make_shared<WatchedValidator>(si, validator_, ear);
        sets_sampler_ = samples && !allocator;
        if (sets_sampler_) allocator = watched_sampler(*si->getStateSpace(), ear);
    }
    Watch(const Watch &) = delete;
    Watch &operator=(const Watch &) = delete;
    ~Watch() {
        si_->getMotionValidator() = validator_;
        if (sets_sampler_) si_->getStateSpace()->clearStateSamplerAllocator();
    }

  private:
    const ob::SpaceInformationPtr si_;
    const ob::MotionValidatorPtr validator_;
    bool sets_sampler_ = false;
};

}  // namespace brrt::detail
