/*
 * springpot.h: creep compensation of dielectric elastomer actuators in C99 and C++11.
 *
 * SPDX-License-Identifier: 0BSD
 *
 * Permission to use, copy, modify, and/or distribute this software for any purpose with or without fee is hereby granted.
 *
 * THE SOFTWARE IS PROVIDED "AS IS" AND THE AUTHOR DISCLAIMS ALL WARRANTIES WITH REGARD TO THIS SOFTWARE INCLUDING ALL IMPLIED
 * WARRANTIES OF MERCHANTABILITY AND FITNESS. IN NO EVENT SHALL THE AUTHOR BE LIABLE FOR ANY SPECIAL, DIRECT, INDIRECT, OR
 * CONSEQUENTIAL DAMAGES OR ANY DAMAGES WHATSOEVER RESULTING FROM LOSS OF USE, DATA OR PROFITS, WHETHER IN AN ACTION OF CONTRACT,
 * NEGLIGENCE OR OTHER TORTIOUS ACTION, ARISING OUT OF OR IN CONNECTION WITH THE USE OR PERFORMANCE OF THIS SOFTWARE.
 *
 * WHAT IT IS
 *
 * The steps of the Rust crate springpot in single precision: the same operations in the same order, so the same bits. This file is
 * the same for every film. The numbers of a film are in their own file, which `springpot export --emit c` writes beside it.
 *
 *   springpot_displacement, springpot_force        the law of a film, force to displacement and displacement to force
 *   springpot_feedforward_*                        a voltage for a reference, without a sensor
 *   springpot_observer_*                           an estimate of the film from voltage and samples of its displacement
 *   springpot_tracking_*                           a voltage for a reference, with a sensor: both of the above on one law
 *   springpot_follower_*                           feedforward or tracking behind learned errors of periodic references
 *   springpot_self_sensing_*                       samples of the displacement from a tone's current into the film
 *
 * Units are SI: m, N, V, s. Displacement is measured from the film at rest under its weight, positive as voltage lengthens it.
 *
 * HOW TO USE IT
 *
 *   #include "springpot.h"
 *   SPRINGPOT_FILM(film_vhb);                      the film of film_vhb.c
 *   static springpot_follower_state state;         the caller owns states; none is allocated
 *
 *   springpot_follower_init(&film_vhb, &state, true, true);
 *   in every tick of film_vhb.step_s seconds:
 *     command = springpot_follower_step(&film_vhb, &state, applied_v, SPRINGPOT_NO_READING, sample or NULL, reference_m);
 *
 * A step cannot fail, allocates nothing, has no recursion and a bounded number of operations. Of the C library it calls sqrtf.
 * Films are const and can be shared; a state belongs to one thread or interrupt at a time.
 *
 * A command respects the limits of the film's file. It is not a safety system: a supervisor must watch voltage, film and host behind it,
 * and hardware must limit both.
 *
 * HOW TO COMPILE IT
 *
 * Any optimisation from -O0 to -O3, any -mcpu or -march with single-precision IEEE 754 arithmetic. Subnormal numbers must not be
 * flushed to zero. Fused multiply-add changes bits: this file switches it off for gcc and clang; give other compilers the option
 * that does (gcc and clang call it -ffp-contract=off). -ffast-math, -Ofast, -funsafe-math-optimizations, -ffinite-math-only,
 * -fassociative-math and -freciprocal-math change bits: gcc 12 and later shows all of them, and they are refused below; clang shows the
 * first two and -ffinite-math-only. -fno-math-errno spares the call of sqrtf. Link with -lm.
 */
#ifndef SPRINGPOT_H
#define SPRINGPOT_H

#include <float.h>
#include <math.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#if defined(__FAST_MATH__) || defined(__ASSOCIATIVE_MATH__) || defined(__RECIPROCAL_MATH__)
#error "springpot.h: -ffast-math and its parts change the bits of every step; compile without them"
#endif
#if defined(__FINITE_MATH_ONLY__)
#if __FINITE_MATH_ONLY__ != 0
#error "springpot.h: -ffinite-math-only breaks the checks of samples and references; compile without it"
#endif
#endif
#if defined(FLT_EVAL_METHOD)
#if FLT_EVAL_METHOD != 0 && FLT_EVAL_METHOD != 16 /* 16: a processor that computes in _Float16, too */
#error "springpot.h: float must be computed in single precision; on x86 compile with -msse2 -mfpmath=sse"
#endif
#endif
#if (FLT_RADIX != 2) || (FLT_MANT_DIG != 24)
#error "springpot.h: float must be the single precision of IEEE 754"
#endif

/* Declares the film `name`, or its self-sensing, which its own file defines. */
#ifdef __cplusplus
#define SPRINGPOT_FILM(name) extern "C" const springpot_film name
#define SPRINGPOT_SELF_SENSING(name) extern "C" const springpot_self_sensing name
#define SPRINGPOT_ASSERT(condition, name) static_assert(condition, #name)
#else
#define SPRINGPOT_FILM(name) extern const springpot_film name
#define SPRINGPOT_SELF_SENSING(name) extern const springpot_self_sensing name
#define SPRINGPOT_ASSERT(condition, name) typedef char springpot_assert_##name[(condition) ? 1 : -1]
#endif

/* What a state and a film point to never overlap. */
#if defined(__GNUC__)
#define SPRINGPOT_RESTRICT __restrict
#elif defined(__cplusplus)
#define SPRINGPOT_RESTRICT
#else
#define SPRINGPOT_RESTRICT restrict
#endif

/* No fused multiply-add from here to the end of this file; of clang, to the end of the file that includes it. */
#if defined(__clang__)
#pragma clang fp contract(off)
#elif defined(__GNUC__)
#pragma GCC push_options
#pragma GCC optimize("fp-contract=off")
#else
#pragma STDC FP_CONTRACT OFF
#endif

/* Loops over modes are unrolled, a sixth of the instructions of a step, unless small code is asked for. */
#if defined(__OPTIMIZE_SIZE__)
#define SPRINGPOT_UNROLL
#elif defined(__clang__)
#define SPRINGPOT_UNROLL _Pragma("clang loop unroll(full)")
#elif defined(__GNUC__) && (__GNUC__ >= 8)
#define SPRINGPOT_UNROLL _Pragma("GCC unroll 24")
#else
#define SPRINGPOT_UNROLL
#endif

/* What films without a spring, or that do not change, would pay for in every step if it were inlined. */
#if defined(__GNUC__)
#define SPRINGPOT_NOT_INLINED __attribute__((__noinline__, __unused__))
#else
#define SPRINGPOT_NOT_INLINED inline
#endif

/* The version of the tables: a film must be of the same. */
#define SPRINGPOT_FORMAT 5U

/* Sizes of a law's memory: exact increments, fast and slow decaying modes. */
#define SPRINGPOT_HEAD 12U
#define SPRINGPOT_FAST 12U
#define SPRINGPOT_SLOW 24U
/* Pieces of an elastic curve, and of a spring. */
#define SPRINGPOT_PIECES 16U
#define SPRINGPOT_SPRING_PIECES 8U
/* Ticks that an observer and a learning remember: samples must not be older. */
#define SPRINGPOT_PAST 64U
/* Harmonics that are learned, beside the mean. */
#define SPRINGPOT_HARMONICS 6U
/* Parameters in which a film may differ from its law, and pairs of them. */
#define SPRINGPOT_PARAMETERS 5U
#define SPRINGPOT_ABOVE 10U
/* Self-sensing: increments and modes of the relation's springpot, and blocks that are kept for a second sensor. */
#define SPRINGPOT_CREEP_HEAD 4U
#define SPRINGPOT_CREEP_MODES 11U
#define SPRINGPOT_BLOCKS 8U
/* There is no reading of a voltage monitor. */
#define SPRINGPOT_NO_READING ((float)NAN)

