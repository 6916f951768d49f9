// What a facet reflectance is made of, one file a lobe: value, density and sample together. Directions are
// unit, away from the surface, in the facet's frame (local_frame.h); those given have z > 0.
//
// For each lobe:
//   add_f(lobe, cell, weight, wi, wo, f)  f[c] += weight(c) * f_lobe(wi, wo)(c), in 1/sr
//   pdf(lobe, cell, wo, wi)               of sample(), per solid angle; at most 1 in all: samples below the
//   facet are lost sample(lobe, cell, wo, u1, u2)        a wi, with z <= 0 where it is lost; random numbers
//   in [0, 1) reflected(lobe, cell, channel, cos_o) about what it reflects of light from wo: the odds of
//   choosing the lobe
#pragma once
#include <span>

#include "directions/direction.h"
#include "material/material.h"

namespace gonio {

// Where maps are looked up.
struct Cell {
    int i = 0, j = 0;
};

void add_f(const Lambertian&, Cell, const Parameter& weight, const Vec3& wi, const Vec3& wo,
           std::span<double> f);
double pdf(const Lambertian&, Cell, const Vec3& wo, const Vec3& wi);
Vec3 sample(const Lambertian&, Cell, const Vec3& wo, double u1, double u2);
double reflected(const Lambertian&, Cell, size_t channel, double cos_o);

void add_f(const Phong&, Cell, const Parameter& weight, const Vec3& wi, const Vec3& wo, std::span<double> f);
double pdf(const Phong&, Cell, const Vec3& wo, const Vec3& wi);
Vec3 sample(const Phong&, Cell, const Vec3& wo, double u1, double u2);
double reflected(const Phong&, Cell, size_t channel, double cos_o);

void add_f(const BlinnPhong&, Cell, const Parameter& weight, const Vec3& wi, const Vec3& wo,
           std::span<double> f);
double pdf(const BlinnPhong&, Cell, const Vec3& wo, const Vec3& wi);
Vec3 sample(const BlinnPhong&, Cell, const Vec3& wo, double u1, double u2);
double reflected(const BlinnPhong&, Cell, size_t channel, double cos_o);

void add_f(const Microfacet&, Cell, const Parameter& weight, const Vec3& wi, const Vec3& wo,
           std::span<double> f);
double pdf(const Microfacet&, Cell, const Vec3& wo, const Vec3& wi);
Vec3 sample(const Microfacet&, Cell, const Vec3& wo, double u1, double u2);
double reflected(const Microfacet&, Cell, size_t channel, double cos_o);

void add_f(const CoatedDiffuse&, Cell, const Parameter& weight, const Vec3& wi, const Vec3& wo,
           std::span<double> f);
double pdf(const CoatedDiffuse&, Cell, const Vec3& wo, const Vec3& wi);
Vec3 sample(const CoatedDiffuse&, Cell, const Vec3& wo, double u1, double u2);
double reflected(const CoatedDiffuse&, Cell, size_t channel, double cos_o);

// No density: add_f and pdf are 0, sample() is the mirrored direction and reflected() exact.
void add_f(const Mirror&, Cell, const Parameter& weight, const Vec3& wi, const Vec3& wo, std::span<double> f);
double pdf(const Mirror&, Cell, const Vec3& wo, const Vec3& wi);
Vec3 sample(const Mirror&, Cell, const Vec3& wo, double u1, double u2);
double reflected(const Mirror&, Cell, size_t channel, double cos_o);

// What a specular facet reflects at this angle, the only thing about it that depends on the channel.
double reflectance(const SpecularReflectance&, Cell, size_t channel, double cos_theta);

// Density cos / pi.
Vec3 cosine_sample(double u1, double u2);

}  // namespace gonio
