"""Files that can be read, as texts."""

from __future__ import annotations

FILM = """[membrane]
thickness = "1 mm"
prestretch = [2.236, 2.236]
relative_permittivity = 4.7
"""
BODY = """[plate]
shape = "circle"
radius = "1 cm"
offset = ["2 mm", "0 mm"]
""" + FILM
OVAL = 'name = "oval"\n[frame]\nshape = "ellipse"\nsemi_axes = ["6 cm", "45 mm"]\n' + BODY
SPECIMENS = {
    "oval": OVAL + 'material = "vhb-4910"\n[electrode]\nmargin_frame = "1 mm"\n'
                   '[electrode.outline]\nshape = "circle"\nradius = "3 cm"\n',
    "ogden": OVAL + '[membrane.material]\nlaw = "ogden"\nmu = ["16 kPa", "0.02 kPa"]\n'
                    'alpha = [2, 4]\nrange = [0.5, 6]\n[[membrane.branch]]\nmodulus = "1 MPa"\n'
                    'time = "30 s"\n[[membrane.branch]]\nmodulus = "20 kPa"\ntime = "1 h"\n',
    "mounted": OVAL + 'material = "vhb-4910"\nmounted = "2 days"\n',
    "polygon": 'name = "polygon"\n[frame]\nshape = "polygon"\nfillet = "2 mm"\nrotation = "5 deg"\n'
               'vertices = [["0 mm", "0 mm"], ["90 mm", "0 mm"], ["90 mm", "80 mm"], '
               '["0 mm", "80 mm"]]\n' + BODY + 'material = "vhb-4910"\n',
    "spline": 'name = "spline"\n[frame]\nshape = "spline"\nthrough = [["60 mm", "0 mm"], '
              '["0 mm", "50 mm"], ["-60 mm", "0 mm"], ["0 mm", "-50 mm"]]\n' + BODY
              + '[membrane.material]\nlaw = "gent"\nmu = "18 kPa"\nj_lim = 110\n',
    "drawn": 'name = "drawn"\n' + BODY + 'material = "vhb-4910"\n[frame]\nshape = "drawn"\n'
             '[[frame.segments]]\nkind = "arc"\ncentre = ["0 mm", "0 mm"]\n'
             'radii = ["45 mm", "45 mm"]\nstart = "0 deg"\nsweep = "180 deg"\n'
             '[[frame.segments]]\nkind = "line"\nstart = ["-45 mm", "0 mm"]\n'
             'end = ["45 mm", "0 mm"]\n',
}
RIG = ('gravity = "9.81 m/s^2"\nspring = "5 N/m"\nsag_voltage = "20 kV"\nsensor_gain = 0.1\n'
       'drift = "1 um/min"\nguide = "free"\nweight_offset = ["1 mm", "0 mm"]\n'
       'plate_pressure = "1 Pa"\nfriction = "1 mN"\nplate_damping = "1 N s/m"\n'
       'added_mass = "1 g"\nseries_resistance = "1 MOhm"\nleakage_resistance = "1 GOhm"\n'
       'sensor_lag = "5 ms"\n')
STUDY = ('name = "study"\nspecimens = ["oval.toml"]\nmass = "17.9 g"\nvoltage = "1 kV"\n'
         '[curves]\nmass = ["17.9 g"]\nvoltage = ["0 kV", "3 kV"]\n[rig]\nspring = "5 N/m"\n')
SWEEP = ('specimen = ["oval.toml"]\nmass = ["17.9 g", "20 g"]\n'
         'voltage = { from = "0 kV", to = "7 kV", count = 15 }\n'
         '[grid]\n"plate.radius" = ["1 cm", "12 mm"]\n"frame.semi_axes" = [["6 cm", "45 mm"]]\n'
         '[list]\n"rig.spring" = ["1 N/m", "2 N/m"]\n'
         '[sample]\nmethod = "sobol"\ncount = 4\nseed = 1\n'
         '[sample.ranges]\n"membrane.thickness" = ["0.5 mm", "1 mm"]\n')
REQUIREMENTS = ('specimen = "oval.toml"\nmass = "17.9 g"\nshare = 0.9\n'
                'front = ["stroke", "work"]\n[want]\nstroke = "largest"\nfrequency = "5 Hz"\n'
                '[bounds]\nwidth = "12 cm"\n[vary]\nvoltage = ["1 kV", "3 kV"]\n'
                '"membrane.prestretch" = [2, 2.5]\n[tolerances.load]\nfilm = 0.01\n'
                '[[film]]\nmaterial = "vhb-4910"\nthickness = ["1 mm"]\nlayers = [1, 2]\n')
DATASET = ('name = "data"\nnoise = "20 um"\n[rig]\ngravity = "9.81 m/s^2"\n[[specimen]]\n'
           + OVAL.replace("[", "[specimen.") .replace("[specimen.2", "[2")
           .replace('= [specimen."', '= ["') + 'material = "vhb-4910"\n')
STATIC = ("specimen,mass_g,voltage_kV,displacement_mm,order,direction,elapsed_s\n"
          + "".join(f"oval,17.9,{volts},{2 + 0.1 * volts:.2f},{volts},up,{60 * volts}\n"
                    for volts in range(6)))
RANGE = "specimen,mass_g,voltage_min_kV,voltage_max_kV,range_mm\noval,17.9,0,5,0.4\n"
TRANSIENT = ("specimen,mass_g,run,t_s,voltage_kV,displacement_mm\n"
             + "".join(f"oval,17.9,a,{0.1 * n:.1f},{3 * (n > 2)},2.{n}\n" for n in range(6)))
COUPON = "mode,stretch,nominal_stress_kPa\nuniaxial,1.5,20\nequibiaxial,2,30\n"
SIGNAL = "t_s,voltage_kV\n0,0\n0.5,1\n1,0.2\n"
