/* What a solver is to mpc_time.c. The tables of problem.h are written by mpc_c.py. */
#ifndef MPC_TIME_H
#define MPC_TIME_H

#ifdef __cplusplus
extern "C" {
#endif

/* Everything that does not depend on the parameters. */
void solver_setup(void);

/* Forgets earlier solutions: the next is cold. */
void solver_forget(void);

/* Whatever else makes the next solution one for these parameters. Not timed; only mpc_step.c has it. */
void solver_prepare(const double *p);

/* From the parameters to the first input. Returns iterations, or -1 if the solver says that it failed. */
int solver_solve(const double *p);

/* All inputs of the last solution. Not timed. */
void solver_answer(double *z);

#ifdef __cplusplus
}
#endif

#endif
