import numpy as np, math, maneuver_automaton as ma
from maneuver_automaton import *
from maneuver_automaton.models import *
from maneuver_automaton.groups import SE2xR, translations
from maneuver_automaton.models.speeds import greatest_speed
# S3: translations in space
m = UserModel(name="drone", group=translations(3), control_names=("ax","ay","az"), control_limits=np.array([[-2,2.]]*3) if False else [[-2,2],[-2,2],[-2,2]], reduced_names=("vx","vy","vz"), reduced_limits=[[-1,1],[-1,1],[-5,5]], velocity=lambda z,u:[z[0],z[1],z[2]], dynamics=lambda z,u:[u[0],u[1],u[2]])
au = Automaton.of_model(m, {"vx":[0.],"vy":[0.],"vz":[0.,4.]})
print([greatest_speed(au.model, axes=a) for a in ((0,1,3),(0,1),(3,))], au.trim_names)
p = Problem(au,[0,0,0],[0,0,20.])
r = ma.plan(p, time_limit=3.0); print("S3", r.status.value, r.cost, r.lower_bound, r.bound and r.bound.kind, r.plan and (r.plan.word), r.reason)
